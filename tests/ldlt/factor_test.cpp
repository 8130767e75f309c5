// L D L^T against Eigen's dense solvers, on any number of ranks.
#include "precompute/ldlt/factor.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <random>
#include <string>

#include "precompute/ldlt/kernels.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/config/error.hpp"
#include "tests/ldlt/pencil.hpp"

namespace carillon::ldlt {
namespace {

using test::make_lattice;
using test::make_random;
using test::MassKind;
using test::Pencil;

// A random block of three rows may be nearly singular, and pivots are not sought outside the blocks.
constexpr double kRandomTolerance = 1e-10;

int find_ranks() {
  int ranks = 1;
  MPI_Comm_size(PETSC_COMM_WORLD, &ranks);
  return ranks;
}

Eigen::VectorXd calc_eigenvalues(const Pencil& pencil) {
  return Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::MatrixXd>(pencil.dense_k, pencil.dense_m, Eigen::EigenvaluesOnly).eigenvalues();
}

std::int64_t count_below(const Eigen::VectorXd& lambda, double sigma) { return (lambda.array() < sigma).count(); }

/// Solves for random right-hand sides and returns max|B - A X| / (||A|| max|X| + max|B|), all of it dense on every rank.
double solve_and_measure(Factor& factor, const Pencil& pencil, double sigma, int columns) {
  const Eigen::Index n = pencil.dense_k.rows();
  std::mt19937 random(7);
  std::normal_distribution<double> value;
  Eigen::MatrixXd b(n, columns);
  for (double& entry : b.reshaped()) entry = value(random);
  const int stride = pencil.rows + 5;  // columns need not be packed
  std::vector<double> x(static_cast<std::size_t>(stride) * columns, 99.0);
  for (int c = 0; c < columns; ++c)
    for (PetscInt i = 0; i < pencil.rows; ++i) x[static_cast<std::size_t>(c) * stride + i] = b(pencil.first_row + i, c);
  factor.solve(x.data(), stride, columns);
  Eigen::MatrixXd solution = Eigen::MatrixXd::Zero(n, columns);
  for (int c = 0; c < columns; ++c) {
    for (PetscInt i = 0; i < pencil.rows; ++i) solution(pencil.first_row + i, c) = x[static_cast<std::size_t>(c) * stride + i];
    for (int i = pencil.rows; i < stride; ++i)
      EXPECT_EQ(x[static_cast<std::size_t>(c) * stride + i], 99.0) << "rows of nobody were written";
  }
  MPI_Allreduce(MPI_IN_PLACE, solution.data(), static_cast<int>(solution.size()), MPI_DOUBLE, MPI_SUM, PETSC_COMM_WORLD);
  const Eigen::MatrixXd a = pencil.dense_k - sigma * pencil.dense_m;
  return (b - a * solution).cwiseAbs().maxCoeff() /
         (a.cwiseAbs().rowwise().sum().maxCoeff() * solution.cwiseAbs().maxCoeff() + b.cwiseAbs().maxCoeff());
}

/// Shifts between eigenvalues all over the spectrum.
std::vector<double> pick_shifts(const Eigen::VectorXd& lambda, int count) {
  std::vector<double> shifts{-0.3};
  for (int i = 1; i < count; ++i) {
    const Eigen::Index k = (lambda.size() - 2) * i / count;
    if (lambda[k + 1] - lambda[k] > 1e-6 * lambda.cwiseAbs().maxCoeff()) shifts.push_back(0.5 * (lambda[k] + lambda[k + 1]));
  }
  return shifts;
}

void expect_counts_and_solves(Pencil& pencil, int shift_count, double tolerance = 1e-12) {
  const Eigen::VectorXd lambda = calc_eigenvalues(pencil);
  Factor factor(pencil.k, pencil.m);
  const std::vector<double> shifts = pick_shifts(lambda, shift_count);
  EXPECT_GT(shifts.size(), 1U);
  for (const double sigma : shifts) {
    ASSERT_TRUE(factor.factorise(sigma)) << sigma << ", backward error " << factor.get_backward_error();
    EXPECT_EQ(factor.get_negative_pivots(), count_below(lambda, sigma)) << sigma;
    EXPECT_LT(factor.get_backward_error(), tolerance);
    EXPECT_LT(solve_and_measure(factor, pencil, sigma, 3), tolerance) << sigma;
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

TEST(factor, solves_any_number_of_columns_alike) {
  const Pencil pencil = make_lattice(8, 5, 3, 1, MassKind::kConsistent, 5);
  Factor factor(pencil.k, pencil.m);
  ASSERT_TRUE(factor.factorise(1.7));
  for (const int columns : {1, 2, 5, 8, 9, 16, 17, 31, 32, 33, 70})
    EXPECT_LT(solve_and_measure(factor, pencil, 1.7, columns), 1e-13) << columns;
}

TEST(factor, works_when_most_ranks_have_no_node) {
  const int ranks = find_ranks();
  for (int nodes : {1, 2, 3}) {
    for (int owner = 0; owner < ranks; ++owner) {
      Pencil pencil = make_random(nodes, 4, 11);
      std::vector<int> nodes_of_rank(ranks, 0);
      nodes_of_rank[owner] = nodes;
      test::distribute(pencil, nodes_of_rank);
      Factor factor(pencil.k, pencil.m);
      ASSERT_TRUE(factor.factorise(0.1));
      EXPECT_EQ(factor.get_negative_pivots(), count_below(calc_eigenvalues(pencil), 0.1));
      EXPECT_LT(solve_and_measure(factor, pencil, 0.1, 5), 1e-13);
    }
  }
}

TEST(factor, works_when_neighbours_lie_on_all_ranks) {
  // Nodes dealt out so that nearly every node touches another rank: hardly any interior is left.
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
  Factor factor(pencil.k, pencil.m);
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
  Factor factor(pencil.k, pencil.m);
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
  Factor factor(pencil.k, pencil.m);
  EXPECT_FALSE(factor.factorise(0.0));
  EXPECT_FALSE(factor.factorise(1.0));
  EXPECT_TRUE(factor.factorise(0.5));
  EXPECT_EQ(factor.get_negative_pivots(), 24);
}

TEST(factor, gives_the_same_bits_twice) {
  const Pencil pencil = make_lattice(9, 5, 3, 1, MassKind::kConsistent, 8);
  std::vector<double> first;
  for (int repeat = 0; repeat < 2; ++repeat) {
    Factor factor(pencil.k, pencil.m);
    ASSERT_TRUE(factor.factorise(2.5));
    std::vector<double> x(static_cast<std::size_t>(pencil.rows) * 4);
    for (std::size_t i = 0; i < x.size(); ++i) x[i] = std::sin(static_cast<double>(i));
    factor.solve(x.data(), pencil.rows, 4);
    if (repeat == 0) first = x;
    EXPECT_EQ(x, first);
  }
}

TEST(factor, says_before_the_work_what_it_will_take) {
  const Pencil pencil = make_lattice(8, 8, 4, 1, MassKind::kDiagonal, 9);
  const Factor factor(pencil.k, pencil.m);
  const Analysis& analysis = factor.get_analysis();
  ASSERT_EQ(static_cast<int>(analysis.ranks.size()), find_ranks());
  std::int64_t entries = 0;
  for (const Analysis::Rank& rank : analysis.ranks) {
    entries += rank.entries;
    EXPECT_GE(rank.peak_bytes, 8 * rank.entries);
  }
  EXPECT_EQ(entries, analysis.entries);
  const auto n = static_cast<std::int64_t>(pencil.dense_k.rows());
  EXPECT_LE(analysis.entries, n * (n + 1) / 2);
  EXPECT_GE(analysis.entries, (pencil.dense_k.array() != 0).count() / 2);
  // Every entry of a column of length c takes part in about c multiplications and additions.
  EXPECT_GE(analysis.flops, static_cast<double>(analysis.entries));
  EXPECT_EQ(find_ranks() > 1, analysis.interface_nodes > 0);
}

TEST(factor, sees_values_that_changed_since_the_analysis) {
  const Pencil pencil = make_lattice(5, 5, 3, 1, MassKind::kDiagonal, 10);
  const Eigen::VectorXd lambda = calc_eigenvalues(pencil);
  Factor factor(pencil.k, pencil.m);
  petsc::check(MatScale(pencil.k, 0.25));
  const double sigma = 0.5 * (lambda[100] + lambda[101]);
  ASSERT_TRUE(factor.factorise(0.25 * sigma));
  EXPECT_EQ(factor.get_negative_pivots(), 101);
}

TEST(factor, names_the_need_when_one_rank_runs_out_of_memory) {
  const Pencil pencil = make_lattice(16, 6, 4, 1, MassKind::kDiagonal, 12);
  Factor factor(pencil.k, pencil.m);
  int rank = 0;
  MPI_Comm_rank(PETSC_COMM_WORLD, &rank);
  rlimit before{};
  getrlimit(RLIMIT_AS, &before);
  long pages = 0;
  std::ifstream("/proc/self/statm") >> pages;
  const rlimit tight{static_cast<rlim_t>(pages) * static_cast<rlim_t>(sysconf(_SC_PAGESIZE)) + 64 * 1024, before.rlim_max};
  // What earlier tests have freed is still this process's: it is taken up first, all but small pieces.
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
  EXPECT_TRUE(factor.factorise(1.0));  // and with memory it goes on
}

TEST(factor, counts_and_solves_alike_with_every_instruction_set_of_this_processor) {
  Pencil pencil = make_lattice(13, 7, 5, 1, MassKind::kConsistent, 14);
  const Eigen::VectorXd lambda = calc_eigenvalues(pencil);
  EXPECT_GE(list_kernels().size(), 1U);
  for (const Kernels* kernels : list_kernels()) {
    set_kernels(kernels);
    Factor factor(pencil.k, pencil.m);
    for (const double sigma : pick_shifts(lambda, 4)) {
      ASSERT_TRUE(factor.factorise(sigma)) << kernels->name << " " << sigma;
      EXPECT_EQ(factor.get_negative_pivots(), count_below(lambda, sigma)) << kernels->name;
      for (const int columns : {1, 8, 13, 32}) EXPECT_LT(solve_and_measure(factor, pencil, sigma, columns), 1e-12) << kernels->name;
    }
  }
  set_kernels(nullptr);
}

TEST(kernels, of_every_instruction_set_multiply_tiles_as_the_definition_says) {
  std::mt19937 random(5);
  std::normal_distribution<double> value;
  for (const Kernels* kernels : list_kernels())
    for (const int m : {3, 6, 9, 12, 15, 39})
      for (const int n : {3, 21, 72})
        for (const int vectors : {1, 2}) {
          const int width = 8 * vectors;
          Eigen::MatrixXd a(m, n), x(n, width), y(m, width);
          for (Eigen::MatrixXd* matrix : {&a, &x, &y})
            for (double& entry : matrix->reshaped()) entry = value(random);
          std::vector<double> tiles;
          for (int i = 0; i < m; i += kTileRows)
            for (int k = 0; k < n; ++k)
              for (int r = i; r < std::min(m, i + kTileRows); ++r) tiles.push_back(a(r, k));
          tiles.resize(tiles.size() + 2048);  // memory is called ahead
          alignas(64) double in[72 * 16], out[72 * 16];
          const auto check = [&](const auto& product, const Eigen::MatrixXd& from, const Eigen::MatrixXd& to,
                                 const Eigen::MatrixXd& expected) {
            for (int i = 0; i < from.rows(); ++i)
              for (int c = 0; c < width; ++c) in[i * width + c] = from(i, c);
            for (int i = 0; i < to.rows(); ++i)
              for (int c = 0; c < width; ++c) out[i * width + c] = to(i, c);
            product(tiles.data(), m, n, vectors, in, out);
            for (int i = 0; i < to.rows(); ++i)
              for (int c = 0; c < width; ++c)
                ASSERT_NEAR(out[i * width + c], expected(i, c), 1e-12) << kernels->name << " " << m << " " << n;
          };
          check(kernels->set_product, x, y, a * x);
          check(kernels->subtract_product, x, y, y - a * x);
          check(kernels->add_transposed, y, x, x + a.transpose() * y);
          check(kernels->subtract_transposed, y, x, x - a.transpose() * y);
        }
}

TEST(factor, refuses_rows_that_are_not_whole_nodes) {
  petsc::MatHandle k;
  petsc::check(MatCreateAIJ(PETSC_COMM_WORLD, 4, 4, PETSC_DETERMINE, PETSC_DETERMINE, 1, nullptr, 0, nullptr, k.out()));
  petsc::check(MatAssemblyBegin(k, MAT_FINAL_ASSEMBLY));
  petsc::check(MatAssemblyEnd(k, MAT_FINAL_ASSEMBLY));
  EXPECT_THROW(Factor(k, k), InputError);
}

}  // namespace
}  // namespace carillon::ldlt
