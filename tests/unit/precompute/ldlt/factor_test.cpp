// L D L^T against dense solvers of Eigen, on any number of ranks.
#include "precompute/ldlt/factor.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <limits>
#include <memory>
#include <random>
#include <string>
#include <utility>

#include "precompute/ldlt/kernels.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/host.hpp"
#include "tests/support/instruction_sets.hpp"
#include "tests/unit/precompute/ldlt/pencil.hpp"

namespace {

int collectives = 0;  // calls over all ranks of a communicator

}  // namespace

// Profiling interface of MPI: intercepts the calls of the library.
extern "C" {
int(MPI_Allreduce)(const void* from, void* to, int count, MPI_Datatype type, MPI_Op op, MPI_Comm comm) {
  ++collectives;
  return PMPI_Allreduce(from, to, count, type, op, comm);
}
int(MPI_Iallreduce)(const void* from, void* to, int count, MPI_Datatype type, MPI_Op op, MPI_Comm comm, MPI_Request* request) {
  ++collectives;
  return PMPI_Iallreduce(from, to, count, type, op, comm, request);
}
int(MPI_Bcast)(void* data, int count, MPI_Datatype type, int root, MPI_Comm comm) {
  ++collectives;
  return PMPI_Bcast(data, count, type, root, comm);
}
int(MPI_Barrier)(MPI_Comm comm) {
  ++collectives;
  return PMPI_Barrier(comm);
}
int(MPI_Allgatherv)(const void* from, int count, MPI_Datatype type, void* to, const int* counts, const int* begin, MPI_Datatype to_type,
                    MPI_Comm comm) {
  ++collectives;
  return PMPI_Allgatherv(from, count, type, to, counts, begin, to_type, comm);
}
}

namespace carillon::ldlt {
namespace {

using test::make_lattice;
using test::make_random;
using test::MassKind;
using test::Pencil;

// A random 3x3 block may be nearly singular, and pivots are sought within blocks only.
constexpr double kRandomTolerance = 1e-10;
// Of 600 lattices and shifts, the factorisation alone has a median of 1e-15, 99 % below 1.3e-13, and at worst 1.4e-12: then solves are
// refined, and the refined solve is measured.
constexpr double kLatticeTolerance = 1e-12;
constexpr double kSolveTolerance = 1e-12;  // bad factorisations have refined solves

int find_ranks() {
  int ranks = 1;
  MPI_Comm_size(PETSC_COMM_WORLD, &ranks);
  return ranks;
}

Eigen::VectorXd calc_eigenvalues(const Pencil& pencil) {
  return Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd>(pencil.dense_k, pencil.dense_m, Eigen::EigenvaluesOnly).eigenvalues();
}

std::int64_t count_below(const Eigen::VectorXd& lambda, double sigma) { return (lambda.array() < sigma).count(); }

/// Solves for random right-hand sides and returns max|B - A X| / (||A|| max|X| + max|B|), dense on every rank.
double solve_and_measure(Factor& factor, const Pencil& pencil, double sigma, int columns) {
  const Eigen::Index n = pencil.dense_k.rows();
  std::mt19937 random(7);
  std::normal_distribution<double> value;
  Eigen::MatrixXd b(n, columns);
  for (double& entry : b.reshaped()) entry = value(random);
  const int stride = pencil.rows + 5;  // columns need not be contiguous
  std::vector<double> x(static_cast<std::size_t>(stride) * columns, 99.0);
  for (int c = 0; c < columns; ++c)
    for (PetscInt i = 0; i < pencil.rows; ++i) x[static_cast<std::size_t>(c) * stride + i] = b(pencil.first_row + i, c);
  factor.solve(x.data(), x.data(), stride, columns);
  Eigen::MatrixXd solution = Eigen::MatrixXd::Zero(n, columns);
  for (int c = 0; c < columns; ++c) {
    for (PetscInt i = 0; i < pencil.rows; ++i) solution(pencil.first_row + i, c) = x[static_cast<std::size_t>(c) * stride + i];
    for (int i = pencil.rows; i < stride; ++i)
      EXPECT_EQ(x[static_cast<std::size_t>(c) * stride + i], 99.0) << "rows of no rank were written";
  }
  MPI_Allreduce(MPI_IN_PLACE, solution.data(), static_cast<int>(solution.size()), MPI_DOUBLE, MPI_SUM, PETSC_COMM_WORLD);
  const Eigen::MatrixXd a = pencil.dense_k - sigma * pencil.dense_m;
  return (b - a * solution).cwiseAbs().maxCoeff() /
         (a.cwiseAbs().rowwise().sum().maxCoeff() * solution.cwiseAbs().maxCoeff() + b.cwiseAbs().maxCoeff());
}

/// Shifts between eigenvalues across the spectrum.
std::vector<double> pick_shifts(const Eigen::VectorXd& lambda, int count) {
  std::vector<double> shifts{-0.3};
  for (int i = 1; i < count; ++i) {
    const Eigen::Index k = (lambda.size() - 2) * i / count;
    if (lambda[k + 1] - lambda[k] > 1e-6 * lambda.cwiseAbs().maxCoeff()) shifts.push_back(0.5 * (lambda[k] + lambda[k + 1]));
  }
  return shifts;
}

void expect_counts_and_solves(Pencil& pencil, int shift_count, double tolerance = kLatticeTolerance) {
  const Eigen::VectorXd lambda = calc_eigenvalues(pencil);
  Factor factor({pencil.k, pencil.m});
  const std::vector<double> shifts = pick_shifts(lambda, shift_count);
  EXPECT_GT(shifts.size(), 1U);
  for (const double sigma : shifts) {
    ASSERT_TRUE(factor.factorise(sigma)) << sigma << ", backward error " << factor.get_backward_error();
    EXPECT_EQ(factor.get_negative_pivots(), count_below(lambda, sigma)) << sigma;
    EXPECT_LT(factor.get_backward_error(), tolerance);
    EXPECT_LT(solve_and_measure(factor, pencil, sigma, 3), kSolveTolerance) << sigma;
  }
}

TEST(factor, counts_and_solves_as_dense_solvers_do_on_a_lattice_with_diagonal_mass) {
  Pencil pencil = make_lattice(7, 6, 3, 1, MassKind::kDiagonal, 1);
  expect_counts_and_solves(pencil, 12);
}

TEST(factor, counts_and_solves_as_dense_solvers_do_on_a_lattice_with_consistent_mass) {
  Pencil pencil = make_lattice(11, 5, 2, 1, MassKind::kConsistent, 2);
  expect_counts_and_solves(pencil, 12);
}

TEST(factor, counts_and_solves_as_dense_solvers_do_on_random_indefinite_matrices) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    Pencil pencil = make_random(20 + 17 * static_cast<int>(seed), 6, seed);
    expect_counts_and_solves(pencil, 8, kRandomTolerance);
  }
}

TEST(factor, counts_and_solves_as_dense_solvers_do_on_a_body_in_pieces) {
  Pencil pencil = make_lattice(4, 3, 2, 5, MassKind::kDiagonal, 3);
  expect_counts_and_solves(pencil, 10);
}

TEST(factor, counts_and_solves_as_dense_solvers_do_when_the_mass_has_links_that_the_stiffness_lacks) {
  Pencil pencil = make_lattice(5, 4, 3, 1, MassKind::kDiagonal, 4);
  const int far = static_cast<int>(pencil.dense_k.rows()) - 3;
  pencil.dense_m(0, far) = pencil.dense_m(far, 0) = 0.1;
  test::distribute(pencil);
  expect_counts_and_solves(pencil, 6);
}

// D K D and D M D have the eigenvalues of K and M; here stiffness spans sixteen decades.
TEST(factor, counts_and_solves_at_every_shift_where_stiffness_spans_many_decades) {
  Pencil pencil = make_lattice(6, 5, 4, 1, MassKind::kConsistent, 15);
  const Eigen::MatrixXd even_k = pencil.dense_k, even_m = pencil.dense_m;
  const Eigen::VectorXd lambda = calc_eigenvalues(pencil);
  Eigen::VectorXd d = Eigen::VectorXd::Ones(pencil.dense_k.rows());
  for (Eigen::Index node = 0; node < d.size() / 3; node += 2) d.segment(3 * node, 3).setConstant(1e8);
  for (Eigen::MatrixXd* dense : {&pencil.dense_k, &pencil.dense_m}) *dense = (d.asDiagonal() * *dense * d.asDiagonal()).eval();
  test::distribute(pencil);
  Factor factor({pencil.k, pencil.m});
  for (const double sigma : pick_shifts(lambda, 6)) {
    ASSERT_TRUE(factor.factorise(sigma)) << sigma << ", backward error " << factor.get_backward_error();
    EXPECT_EQ(factor.get_negative_pivots(), count_below(lambda, sigma)) << sigma;
    EXPECT_LT(factor.get_backward_error(), kLatticeTolerance);
    // D b to D^-1 x, and x to b.
    Eigen::VectorXd b(d.size());
    for (Eigen::Index i = 0; i < b.size(); ++i) b[i] = std::sin(1.0 + static_cast<double>(i));
    const Eigen::VectorXd scaled = b.cwiseProduct(d);
    Eigen::VectorXd x = Eigen::VectorXd::Zero(d.size());
    factor.solve(scaled.data() + pencil.first_row, x.data() + pencil.first_row, pencil.rows, 1);
    x = x.cwiseProduct(d).eval();
    MPI_Allreduce(MPI_IN_PLACE, x.data(), static_cast<int>(x.size()), MPI_DOUBLE, MPI_SUM, PETSC_COMM_WORLD);
    const Eigen::MatrixXd a = even_k - sigma * even_m;
    const double scale = a.cwiseAbs().rowwise().sum().maxCoeff() * x.cwiseAbs().maxCoeff() + b.cwiseAbs().maxCoeff();
    EXPECT_LT((b - a * x).cwiseAbs().maxCoeff(), kSolveTolerance * scale) << sigma;
  }
}

TEST(factor, solves_any_number_of_columns_alike) {
  const Pencil pencil = make_lattice(8, 5, 3, 1, MassKind::kConsistent, 5);
  Factor factor({pencil.k, pencil.m});
  ASSERT_TRUE(factor.factorise(1.7));
  for (const int columns : {1, 2, 5, 8, 9, 16, 17, 31, 32, 33, 70})
    EXPECT_LT(solve_and_measure(factor, pencil, 1.7, columns), 1e-13) << columns;
}

// A collective makes all ranks wait for the slowest. A factorisation has three: agreement on memory, the sum of the inertia at its end, and
// agreement that memory sufficed; others counted here belong to the measurement of its error.
TEST(factor, solves_without_a_collective) {
  const Pencil pencil = make_lattice(12, 6, 4, 1, MassKind::kConsistent, 16);
  Factor factor({pencil.k, pencil.m});
  ASSERT_TRUE(factor.factorise(1.3));
  std::vector<double> b(static_cast<std::size_t>(std::max<PetscInt>(pencil.rows, 1)) * 40, 1.0);
  collectives = 0;
  factor.solve(b.data(), b.data(), std::max<PetscInt>(pencil.rows, 1), 40);
  EXPECT_EQ(collectives, 0);
  ASSERT_TRUE(factor.factorise(1.4));
  const int first = std::exchange(collectives, 0);
  ASSERT_TRUE(factor.factorise(1.5));
  EXPECT_EQ(collectives, first) << "the same number for every shift";
  EXPECT_LE(first, 16);
}

TEST(factor, works_when_most_ranks_have_no_node) {
  const int ranks = find_ranks();
  for (int nodes : {1, 2, 3}) {
    for (int owner = 0; owner < ranks; ++owner) {
      Pencil pencil = make_random(nodes, 4, 11);
      std::vector<int> nodes_of_rank(ranks, 0);
      nodes_of_rank[owner] = nodes;
      test::distribute(pencil, nodes_of_rank);
      Factor factor({pencil.k, pencil.m});
      ASSERT_TRUE(factor.factorise(0.1));
      EXPECT_EQ(factor.get_negative_pivots(), count_below(calc_eigenvalues(pencil), 0.1));
      EXPECT_LT(solve_and_measure(factor, pencil, 0.1, 5), 1e-13);
    }
  }
}

TEST(factor, works_when_neighbours_lie_on_all_ranks) {
  // Nodes distributed so that nearly every node has a neighbour on another rank: almost no interior.
  Pencil pencil = make_random(60, 12, 21);
  std::vector<int> nodes_of_rank(find_ranks(), 1);
  nodes_of_rank.back() = 60 - (find_ranks() - 1);
  test::distribute(pencil, nodes_of_rank);
  expect_counts_and_solves(pencil, 5, kRandomTolerance);
  Pencil even = make_random(60, 12, 22);
  expect_counts_and_solves(even, 5, kRandomTolerance);
}

TEST(factor, takes_a_shift_below_the_rigid_motions_however_small) {
  const Pencil pencil = make_lattice(6, 5, 4, 2, MassKind::kDiagonal, 6);
  const double top = calc_eigenvalues(pencil).maxCoeff();
  Factor factor({pencil.k, pencil.m});
  for (const double relative : {1e-4, 1e-7, 1e-10}) {
    ASSERT_TRUE(factor.factorise(-relative * top)) << relative;
    EXPECT_EQ(factor.get_negative_pivots(), 0) << relative;
    ASSERT_TRUE(factor.factorise(relative * top)) << relative;
    EXPECT_EQ(factor.get_negative_pivots(), 12) << relative;
  }
}

TEST(factor, counts_right_or_refuses_within_1e_8_of_an_eigenvalue) {
  const Pencil pencil = make_lattice(6, 4, 3, 1, MassKind::kConsistent, 7);
  const Eigen::VectorXd lambda = calc_eigenvalues(pencil);
  Factor factor({pencil.k, pencil.m});
  int counted = 0;
  for (Eigen::Index k = 10; k < lambda.size() - 1; k += 17)
    for (const double relative : {-1e-8, 1e-8, -1e-10, 1e-10}) {
      const double sigma = lambda[k] * (1 + relative);
      if (!factor.factorise(sigma)) continue;
      ++counted;
      EXPECT_EQ(factor.get_negative_pivots(), count_below(lambda, sigma)) << k << " " << relative;
    }
  EXPECT_GT(counted, 20);
}

TEST(factor, refuses_a_singular_matrix) {
  Pencil pencil = make_random(12, 4, 31);
  pencil.dense_k.setZero();
  for (int v = 0; v < 12; ++v) pencil.dense_k(3 * v, 3 * v) = 1;  // two zero rows per node
  test::distribute(pencil);
  Factor factor({pencil.k, pencil.m});
  EXPECT_FALSE(factor.factorise(0.0));
  EXPECT_FALSE(factor.factorise(1.0));
  EXPECT_TRUE(factor.factorise(0.5));
  EXPECT_EQ(factor.get_negative_pivots(), 24);
}

TEST(factor, gives_the_same_bits_twice_and_in_place) {
  const Pencil pencil = make_lattice(9, 5, 3, 1, MassKind::kConsistent, 8);
  std::vector<double> first;
  for (int repeat = 0; repeat < 2; ++repeat) {
    Factor factor({pencil.k, pencil.m});
    ASSERT_TRUE(factor.factorise(2.5));
    std::vector<double> b(pencil.rows * 4);
    for (std::size_t i = 0; i < b.size(); ++i) b[i] = std::sin(static_cast<double>(i));
    const std::vector<double> given = b;
    if (repeat == 0) {
      first.assign(b.size(), 99.0);
      factor.solve(b.data(), first.data(), pencil.rows, 4);
      EXPECT_EQ(b, given);
    } else {
      factor.solve(b.data(), b.data(), pencil.rows, 4);
      EXPECT_EQ(b, first);
    }
  }
}

TEST(factor, predicts_its_cost) {
  const Pencil pencil = make_lattice(8, 8, 4, 1, MassKind::kDiagonal, 9);
  const Factor factor({pencil.k, pencil.m});
  const Analysis& analysis = factor.get_analysis();
  ASSERT_EQ(static_cast<int>(analysis.ranks.size()), find_ranks());
  std::int64_t entries = 0;
  double flops = 0;
  for (const Analysis::Rank& rank : analysis.ranks) {
    entries += rank.entries;
    EXPECT_GE(rank.peak_bytes, 8 * rank.entries);
    flops += rank.flops;
  }
  EXPECT_NEAR(flops, analysis.flops, 1e-12 * flops);
  EXPECT_EQ(entries, analysis.entries);
  const auto n = static_cast<std::int64_t>(pencil.dense_k.rows());
  EXPECT_LE(analysis.entries, n * (n + 1) / 2);
  EXPECT_GE(analysis.entries, (pencil.dense_k.array() != 0).count() / 2);
  // Every entry of a column of length c takes part in about c multiplications and additions.
  EXPECT_GE(analysis.flops, static_cast<double>(analysis.entries));
  EXPECT_EQ(find_ranks() > 1, analysis.shared_nodes > 0);
}

TEST(factor, sees_values_that_changed_since_the_analysis) {
  const Pencil pencil = make_lattice(5, 5, 3, 1, MassKind::kDiagonal, 10);
  const Eigen::VectorXd lambda = calc_eigenvalues(pencil);
  Factor factor({pencil.k, pencil.m});
  petsc::check(MatScale(pencil.k, 0.25));
  const double sigma = 0.5 * (lambda[100] + lambda[101]);
  ASSERT_TRUE(factor.factorise(0.25 * sigma));
  EXPECT_EQ(factor.get_negative_pivots(), 101);
}

TEST(factor, names_the_need_when_one_rank_runs_out_of_memory) {
  const Pencil pencil = make_lattice(16, 6, 4, 1, MassKind::kDiagonal, 12);
  Factor factor({pencil.k, pencil.m});
  int rank = 0;
  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  rlimit before{};
  getrlimit(RLIMIT_AS, &before);
  long pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  const rlimit tight{static_cast<rlim_t>(pages) * static_cast<rlim_t>(sysconf(_SC_PAGESIZE)) + 64 * 1024, before.rlim_max};
  // Memory freed by earlier tests still belongs to the process: allocate it first, except small blocks.
  std::vector<void*> hoard;
  hoard.reserve(100'000);
  if (rank == find_ranks() - 1) {
    setrlimit(RLIMIT_AS, &tight);
    while (void* piece = std::malloc(256 * 1024)) hoard.push_back(piece);
  }
  std::string message;
  try {
    (void)factor.factorise(1.0);
  } catch (const SystemError& error) {
    message = error.what();
  }
  setrlimit(RLIMIT_AS, &before);
  for (void* piece : hoard) std::free(piece);
  EXPECT_NE(message.find(" GB"), std::string::npos) << "rank " << rank << ": '" << message << "'";
  EXPECT_TRUE(factor.factorise(1.0));  // and with memory it continues
}

TEST(factor, counts_and_solves_alike_with_every_instruction_set_of_this_processor) {
  Pencil pencil = make_lattice(13, 7, 5, 1, MassKind::kConsistent, 14);
  const Eigen::VectorXd lambda = calc_eigenvalues(pencil);
  tests::for_each_instruction_set([&] {
    Factor factor({pencil.k, pencil.m});
    for (const double sigma : pick_shifts(lambda, 4)) {
      ASSERT_TRUE(factor.factorise(sigma)) << sigma;
      EXPECT_EQ(factor.get_negative_pivots(), count_below(lambda, sigma));
      for (const int columns : {1, 8, 13, 32}) EXPECT_LT(solve_and_measure(factor, pencil, sigma, columns), kSolveTolerance);
    }
  });
}

Eigen::MatrixXd make_numbers(int rows, int columns, std::mt19937& random) {
  std::normal_distribution<double> value;
  return Eigen::MatrixXd::NullaryExpr(rows, columns, [&] { return value(random); });
}

/// Tiles as defined in kernels.hpp; `is_triangle`: each only up to the diagonal of its last row.
std::vector<double> make_tiles(const Eigen::MatrixXd& a, bool is_triangle) {
  std::vector<double> tiles;
  for (int i = 0; i < a.rows(); i += kTileRows) {
    const int behind = std::min<int>(static_cast<int>(a.rows()), i + kTileRows);
    for (int k = 0; k < (is_triangle ? behind : a.cols()); ++k)
      for (int r = i; r < behind; ++r) tiles.push_back(a(r, k));
  }
  tiles.resize(tiles.size() + 2048);  // prefetched beyond the end
  return tiles;
}

TEST(kernels, of_every_instruction_set_multiply_tiles_as_the_definition_says) {
  std::mt19937 random(5);
  tests::for_each_instruction_set([&] {
    const SolveKernels& kernels = find_solve_kernels();
    for (const int m : {3, 6, 9, 12, 15, 39})
      for (const int n : {3, 21, 72})
        for (const int vectors : {1, 2}) {
          const int width = 8 * vectors;
          const Eigen::MatrixXd a = make_numbers(m, n, random);
          const std::vector<double> tiles = make_tiles(a, false);
          // Node i of the block refers to rows 3 nodes[i] ... of X; the others must not change.
          std::vector<int> nodes(m / 3), row_of(m);
          for (int i = 0; i < m / 3; ++i) nodes[i] = (5 * i + 3) % 17;
          for (int i = 0; i < m; ++i) row_of[i] = 3 * nodes[i / 3] + i % 3;
          const Eigen::MatrixXd x = make_numbers(3 * 17, width, random);
          const Eigen::MatrixXd y = make_numbers(n, width, random);
          alignas(64) double rows[3 * 17 * 16], block[72 * 16];
          const auto put = [width](const Eigen::MatrixXd& from, double* to) {
            for (int i = 0; i < from.rows(); ++i)
              for (int c = 0; c < width; ++c) to[i * width + c] = from(i, c);
          };
          const auto expect = [&](const double* out, const Eigen::MatrixXd& expected) {
            for (int i = 0; i < expected.rows(); ++i)
              for (int c = 0; c < width; ++c) ASSERT_NEAR(out[i * width + c], expected(i, c), 1e-12) << m << " " << n;
          };
          put(x, rows);
          put(y, block);
          kernels.subtract_product(tiles.data(), m, n, vectors, block, nodes.data(), rows);
          Eigen::MatrixXd wanted = x;
          for (int i = 0; i < m; ++i) wanted.row(row_of[i]) -= a.row(i) * y;
          expect(rows, wanted);
          put(x, rows);
          kernels.subtract_transposed(tiles.data(), m, n, vectors, nodes.data(), rows, block, tiles.data());
          wanted = y;
          for (int i = 0; i < m; ++i) wanted -= a.row(i).transpose() * x.row(row_of[i]);
          expect(block, wanted);
        }
  });
}

TEST(kernels, of_every_instruction_set_multiply_triangles) {
  std::mt19937 random(6);
  tests::for_each_instruction_set([&] {
    const SolveKernels& kernels = find_solve_kernels();
    for (const int n : {3, 12, 18, 57, 72})
      for (const int vectors : {1, 2}) {
        const int width = 8 * vectors;
        const Eigen::MatrixXd a = make_numbers(n, n, random).triangularView<Eigen::Lower>();
        const std::vector<double> tiles = make_tiles(a, true);
        ASSERT_EQ(static_cast<std::int64_t>(tiles.size()) - 2048, count_triangle(n));
        const Eigen::MatrixXd x = make_numbers(n, width, random);
        alignas(64) double in[72 * 16], out[72 * 16];
        for (int i = 0; i < n * width; ++i) in[i] = out[i] = x(i / width, i % width);
        kernels.add_trmm_transposed(tiles.data(), n, vectors, in, out, tiles.data());
        const Eigen::MatrixXd sum = x + a.transpose() * x;
        for (int i = 0; i < n * width; ++i) ASSERT_NEAR(out[i], sum(i / width, i % width), 1e-12) << n;
        kernels.trmm(tiles.data(), n, vectors, in, out);
        const Eigen::MatrixXd product = a * x;
        for (int i = 0; i < n * width; ++i) ASSERT_NEAR(out[i], product(i / width, i % width), 1e-12) << n;
      }
  });
}

// A front of w pivots in one panel, and r rows behind it: L and the update matrix against dense algebra, with the update matrix overwritten
// or added to.
TEST(kernels, of_every_instruction_set_eliminate_a_panel) {
  std::mt19937 random(7);
  tests::for_each_instruction_set([&] {
    const FactorKernels& kernels = find_factor_kernels();
    for (const int w : {3, 15, 36, 72})
      for (const int r : {3, 12, 30, 96, 201})
        for (const bool is_made : {false, true}) {
          Eigen::MatrixXd a = make_numbers(w + r, w + r, random);
          a = (a + a.transpose()).eval();
          const Eigen::MatrixXd schur = a.bottomRightCorner(r, r) * (is_made ? 0 : 1) -
                                        a.bottomLeftCorner(r, w) * a.topLeftCorner(w, w).fullPivLu().solve(a.topRightCorner(w, r));
          Eigen::MatrixXd front = a;
          if (is_made) front.bottomRightCorner(r, r).setConstant(std::numeric_limits<double>::quiet_NaN());
          alignas(64) double block[kMaxBlock * kMaxBlock];
          for (int j = 0; j < w; ++j)
            for (int i = 0; i < w; ++i) block[j * kMaxBlock + i] = a(i, j);
          BlockPivots pivots;
          std::vector<double> triangle(count_triangle(w)), tiles(r * w);
          ASSERT_TRUE(kernels.factorise_block(block, w, pivots, triangle.data()));
          std::vector<double*> columns(w + r);
          const double* ordered[kMaxBlock];
          for (int j = 0; j < w + r; ++j) columns[j] = front.col(j).data();
          for (int k = 0; k < w; ++k) ordered[k] = columns[pivots.order[k]];
          const auto wide = std::unique_ptr<double, void (*)(void*)>(
              static_cast<double*>(std::aligned_alloc(64, sizeof(double) * w * (r + kWideRows) / 64 * 64 + 64)), std::free);
          double growth = 0;
          kernels.trsm(ordered, w, w + r, w, triangle.data(), wide.get());
          kernels.scale_by_d_inverse(wide.get(), 0, r, w, pivots, tiles.data(), growth);
          kernels.update({tiles.data(), wide.get(), w, w}, w, w + r, is_made, columns.data());
          const double scale = schur.cwiseAbs().maxCoeff() + a.cwiseAbs().maxCoeff();
          double largest = 0;
          for (const double l : tiles) largest = std::max(largest, std::abs(l));
          EXPECT_EQ(growth, largest);
          const double tolerance = 1e-12 * scale * std::max(1.0, growth);
          for (int j = 0; j < r; ++j)
            for (int i = j; i < r; ++i) ASSERT_NEAR(front(w + i, w + j), schur(i, j), tolerance) << w << " " << r << " " << i << " " << j;
        }
  });
}

TEST(factor, refuses_rows_that_are_not_whole_nodes) {
  petsc::MatHandle k;
  petsc::check(MatCreateAIJ(PETSC_COMM_WORLD, 4, 4, PETSC_DETERMINE, PETSC_DETERMINE, 1, nullptr, 0, nullptr, k.out()));
  petsc::check(MatAssemblyBegin(k, MAT_FINAL_ASSEMBLY));
  petsc::check(MatAssemblyEnd(k, MAT_FINAL_ASSEMBLY));
  EXPECT_THROW(Factor({k, k}), InputError);
}

TEST(Factor, keeps_the_memory_of_a_factorisation_for_the_next_and_gives_it_back_at_the_first_solve) {
  if (find_ranks() > 1) GTEST_SKIP() << "memory of MPI changes by the same amount";
  const Pencil lattice = make_lattice(11, 11, 11, 1, MassKind::kDiagonal, 5);
  const la::Pencil pencil{lattice.k, lattice.m};
  const auto find_resident = [] { return static_cast<double>(base::find_memory().resident); };
  constexpr double kSlack = 1 << 20;
  const double before = find_resident();
  double kept = 0;
  {
    Factor factor(pencil);
    std::vector<double> x(lattice.rows + 1, 1.0);
    const auto solve = [&] { factor.solve(x.data(), x.data(), std::max<int>(lattice.rows, 1), 1); };
    ASSERT_TRUE(factor.factorise(-1.0));
    solve();
    const double solved = find_resident();
    for (int round = 0; round < 5; ++round) {
      ASSERT_TRUE(factor.factorise(-1.0 - round));
      kept = find_resident();
      ASSERT_TRUE(factor.factorise(-1.5 - round));
      EXPECT_NEAR(find_resident(), kept, kSlack) << "another factorisation uses the same pages";
      solve();
      EXPECT_NEAR(find_resident(), solved, kSlack) << "round " << round;
    }
    EXPECT_GT(kept - solved, kSlack) << "no memory was kept";
    ASSERT_TRUE(factor.factorise(-1.0));
  }
  EXPECT_LT(find_resident() - before, kept - before) << "kept memory must be freed with the factor";
}

}  // namespace
}  // namespace carillon::ldlt
