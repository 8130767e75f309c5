// Method:     Rayleigh quotients, residuals and Gram matrix with matrix-matrix products; Gram-Schmidt as Cholesky of the Gram matrix.
// Source:     Parlett, The symmetric eigenvalue problem, 1998, section 4.5 (a residual bounds the error of its eigenvalue); Golub, Van
//             Loan, Matrix Computations, sections 2.7 (rounding of products) and 5.2 (orthonormal bases).
// Deviations: none.
#include "precompute/eigen/check_modes.hpp"

#include <fmt/core.h>
#include <petscblaslapack.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <tuple>

#include "precompute/eigen/local_columns.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/config/error.hpp"

namespace carillon::eigen {
namespace {

using petsc::check;

constexpr double kTieTolerance = 1e-4;          // Far above the errors of shapes, so that rounding breaks no tie.
constexpr double kRoundOff = 10;                // Refined modes of thin shelves come out at 1 to 2.
constexpr int kStrip = 4 * NodeMatrix::kStrip;  // Columns at a time: wide enough for BLAS to run at full speed in the Gram matrix.

std::vector<double> read_diagonal(Mat matrix) {
  petsc::VecHandle diagonal;
  check(MatCreateVecs(matrix, nullptr, diagonal.out()));
  check(MatGetDiagonal(matrix, diagonal));
  PetscInt rows = 0;
  const PetscScalar* values = nullptr;
  check(VecGetLocalSize(diagonal, &rows));
  check(VecGetArrayRead(diagonal, &values));
  std::vector<double> copy(values, values + rows);
  check(VecRestoreArrayRead(diagonal, &values));
  return copy;
}

void sum_over_ranks(MPI_Comm comm, std::vector<double>& values) {
  MPI_Allreduce(MPI_IN_PLACE, values.data(), static_cast<int>(values.size()), MPI_DOUBLE, MPI_SUM, comm);
}

// Sums of `kSums` terms each over the rows. Eight of each at a time, so that they need not wait for one another.
template <std::size_t kSums, typename Terms>
std::array<double, kSums> sum_rows(std::ptrdiff_t rows, Terms&& terms) {
  constexpr std::ptrdiff_t kLanes = 8;
  double lanes[kSums][kLanes] = {};
  std::ptrdiff_t i = 0;
  for (; i + kLanes <= rows; i += kLanes) {
    for (std::ptrdiff_t lane = 0; lane < kLanes; ++lane) {
      const std::array<double, kSums> term = terms(i + lane);
      for (std::size_t k = 0; k < kSums; ++k) lanes[k][lane] += term[k];
    }
  }
  for (; i < rows; ++i) {
    const std::array<double, kSums> term = terms(i);
    for (std::size_t k = 0; k < kSums; ++k) lanes[k][0] += term[k];
  }
  std::array<double, kSums> sums{};
  for (std::size_t k = 0; k < kSums; ++k) sums[k] = std::accumulate(lanes[k], lanes[k] + kLanes, 0.0);
  return sums;
}

// Some columns of a block with K and M times them.
struct Strip {
  Columns phi, m_phi, k_phi;
};

// (phi^T M phi, phi^T K phi) of each column.
std::vector<double> calc_energies(MPI_Comm comm, const Strip& strip) {
  std::vector<double> energies;
  for (int j = 0; j < strip.phi.count; ++j) {
    const double* phi = strip.phi.column(j);
    const double* m_phi = strip.m_phi.column(j);
    const double* k_phi = strip.k_phi.column(j);
    const auto sums = sum_rows<2>(strip.phi.rows, [=](std::ptrdiff_t i) { return std::array{phi[i] * m_phi[i], phi[i] * k_phi[i]}; });
    energies.insert(energies.end(), sums.begin(), sums.end());
  }
  sum_over_ranks(comm, energies);
  return energies;
}

}  // namespace

Operators::Operators(Mat stiffness_mat, Mat mass_mat)
    : stiffness(stiffness_mat), mass(mass_mat), stiffness_diagonal(read_diagonal(stiffness_mat)), mass_diagonal(read_diagonal(mass_mat)) {
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(stiffness_mat), &comm));
}

ModeErrors normalise_and_measure(const Operators& operators, std::vector<double>& lambda, Mat shapes) {
  const std::size_t modes = lambda.size();
  ModeErrors errors;
  if (modes == 0) return errors;
  const LocalColumns access(shapes);
  const Columns phi = access.view();
  const auto rows = static_cast<std::size_t>(phi.rows);
  std::vector<double> m_space(rows * kStrip);
  std::vector<double> k_space(rows * kStrip);
  std::vector<double> gram(modes * modes, 0.0);
  std::vector<double> square(modes);         // phi^T M phi
  std::vector<double> sums(3 * modes, 0.0);  // squares of the residual, of M phi and of diag(K) phi
  for (int first = 0; first < phi.count; first += kStrip) {
    const int width = std::min(kStrip, phi.count - first);
    const Strip strip{phi.part(first, width), {m_space.data(), phi.rows, phi.rows, width}, {k_space.data(), phi.rows, phi.rows, width}};
    operators.mass.multiply(strip.phi, strip.m_phi);
    operators.stiffness.multiply(strip.phi, strip.k_phi);
    const std::vector<double> energies = calc_energies(operators.comm, strip);
    for (int c = 0; c < width; ++c) {
      const auto j = static_cast<std::size_t>(first + c);
      square[j] = energies[static_cast<std::size_t>(2 * c)];
      lambda[j] = energies[static_cast<std::size_t>(2 * c + 1)] / square[j];
      const double* m_phi = strip.m_phi.column(c);
      const double* k_phi = strip.k_phi.column(c);
      const double* own = strip.phi.column(c);
      const double* diagonal = operators.stiffness_diagonal.data();
      const auto squares = sum_rows<3>(phi.rows, [=, value = lambda[j]](std::ptrdiff_t i) {
        const double rest = k_phi[i] - value * m_phi[i];
        const double term = diagonal[i] * own[i];
        return std::array{rest * rest, m_phi[i] * m_phi[i], term * term};
      });
      std::copy(squares.begin(), squares.end(), sums.begin() + static_cast<std::ptrdiff_t>(3 * j));
    }
    multiply_transposed(phi.part(0, first + width), strip.m_phi, gram.data() + static_cast<std::size_t>(first) * modes, phi.count);
  }
  sum_over_ranks(operators.comm, sums);
  MPI_Allreduce(MPI_IN_PLACE, gram.data(), static_cast<int>(gram.size()), MPI_DOUBLE, MPI_SUM, operators.comm);
  for (std::size_t j = 0; j < modes; ++j) {
    const double scale = lambda[j] * std::sqrt(sums[3 * j + 1]);
    errors.residual.push_back(std::sqrt(sums[3 * j]) / scale);
    errors.floor.push_back(kRoundOff * PETSC_MACHINE_EPSILON * std::sqrt(sums[3 * j + 2]) / scale);
    for (std::size_t i = 0; i < j; ++i)
      errors.orthonormality = std::max(errors.orthonormality, std::abs(gram[j * modes + i]) / std::sqrt(square[i] * square[j]));
    const double factor = 1 / std::sqrt(square[j]);
    double* column = phi.column(static_cast<int>(j));
    for (std::size_t i = 0; i < rows; ++i) column[i] *= factor;
  }
  return errors;
}

void sort_modes(std::vector<double>& lambda, Mat shapes, ModeErrors& errors) {
  if (std::is_sorted(lambda.begin(), lambda.end())) return;
  std::vector<std::size_t> order(lambda.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return lambda[a] < lambda[b]; });
  for (std::vector<double>* values : {&lambda, &errors.residual, &errors.floor}) {
    const std::vector<double> old = *values;
    for (std::size_t j = 0; j < order.size(); ++j) (*values)[j] = old[order[j]];
  }
  const LocalColumns columns(shapes);
  permute_columns(columns.view(), order);
}

void orthonormalise_shapes(const Operators& operators, Mat shapes) {
  const LocalColumns access(shapes);
  const Columns phi = access.view();
  const auto modes = static_cast<std::size_t>(phi.count);
  std::vector<double> gram(modes * modes, 0.0);
  std::vector<double> space(static_cast<std::size_t>(phi.rows) * kStrip);
  for (int first = 0; first < phi.count; first += kStrip) {
    const int width = std::min(kStrip, phi.count - first);
    const Columns m_phi{space.data(), phi.rows, phi.rows, width};
    operators.mass.multiply(phi.part(first, width), m_phi);
    multiply_transposed(phi.part(0, first + width), m_phi, gram.data() + static_cast<std::size_t>(first) * modes, phi.count);
  }
  sum_over_ranks(operators.comm, gram);
  PetscBLASInt rows = static_cast<PetscBLASInt>(phi.rows);
  PetscBLASInt count = phi.count;
  PetscBLASInt stride = static_cast<PetscBLASInt>(std::max<std::ptrdiff_t>(phi.stride, 1));
  PetscBLASInt info = 0;
  double one = 1;
  LAPACKpotrf_("U", &count, gram.data(), &count, &info);
  if (info != 0)
    throw SolveError(fmt::format("Mode {} is a combination of lower ones: it converged twice. Solve the band in parts.", info));
  if (rows > 0) BLAStrsm_("R", "U", "N", "N", &rows, &count, &one, gram.data(), &count, phi.values, &stride);
}

void orient_shapes(Mat shapes, const std::vector<Vec3>& positions) {
  MPI_Comm comm = MPI_COMM_NULL;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(shapes), &comm));
  int rank = 0;
  int size = 1;
  MPI_Comm_rank(comm, &rank);
  MPI_Comm_size(comm, &size);
  const LocalColumns phi(shapes);
  const auto modes = static_cast<std::size_t>(phi.columns);
  std::vector<double> largest(modes, 0.0);
  for (std::size_t j = 0; j < modes; ++j) {
    const double* column = phi.column(static_cast<PetscInt>(j));
    double lanes[8] = {};
    PetscInt i = 0;
    for (; i + 8 <= phi.rows; i += 8) {
      for (PetscInt lane = 0; lane < 8; ++lane) lanes[lane] = std::max(lanes[lane], std::abs(column[i + lane]));
    }
    for (; i < phi.rows; ++i) lanes[0] = std::max(lanes[0], std::abs(column[i]));
    largest[j] = *std::max_element(lanes, lanes + 8);
  }
  MPI_Allreduce(MPI_IN_PLACE, largest.data(), static_cast<int>(modes), MPI_DOUBLE, MPI_MAX, comm);

  // Each rank's first candidate by (x, y, z, axis); all ranks' candidates meet everywhere.
  using Candidate = std::array<double, 5>;  // x, y, z, axis, entry; entry 0: none
  std::vector<Candidate> mine(modes, Candidate{0, 0, 0, 0, 0});
  const auto comes_first = [](const Candidate& a, const Candidate& b) {
    if ((a[4] != 0) != (b[4] != 0)) return a[4] != 0;
    return std::tie(a[0], a[1], a[2], a[3]) < std::tie(b[0], b[1], b[2], b[3]);
  };
  for (std::size_t j = 0; j < modes; ++j) {
    const double* column = phi.column(static_cast<PetscInt>(j));
    for (PetscInt i = 0; i < phi.rows; ++i) {
      if (std::abs(column[i]) < (1 - kTieTolerance) * largest[j]) continue;
      const Vec3& x = positions[static_cast<std::size_t>(i / 3)];
      const Candidate candidate{x[0], x[1], x[2], static_cast<double>(i % 3), column[i]};
      if (comes_first(candidate, mine[j])) mine[j] = candidate;
    }
  }
  std::vector<Candidate> all(modes * static_cast<std::size_t>(size));
  const int count = static_cast<int>(5 * modes);
  MPI_Allgather(mine.data(), count, MPI_DOUBLE, all.data(), count, MPI_DOUBLE, comm);
  for (std::size_t j = 0; j < modes; ++j) {
    Candidate first = all[j];
    for (std::size_t r = 1; r < static_cast<std::size_t>(size); ++r) {
      if (comes_first(all[r * modes + j], first)) first = all[r * modes + j];
    }
    if (first[4] >= 0) continue;
    double* column = phi.column(static_cast<PetscInt>(j));
    for (PetscInt i = 0; i < phi.rows; ++i) column[i] = -column[i];
  }
}

}  // namespace carillon::eigen
