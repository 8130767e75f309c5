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
#include <numeric>
#include <tuple>

#include "precompute/eigen/local_columns.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/config/error.hpp"

namespace carillon::eigen {
namespace {

using petsc::check;

constexpr double kTieTolerance = 1e-6;
constexpr double kRoundOff = 10;  // Refined modes of thin shelves come out at 1 to 2.

}  // namespace

ModeErrors normalise_and_measure(Mat stiffness, Mat mass, std::vector<double>& lambda, Mat shapes) {
  MPI_Comm comm = MPI_COMM_NULL;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(stiffness), &comm));
  const std::size_t modes = lambda.size();
  ModeErrors errors;
  if (modes == 0) return errors;
  petsc::MatHandle m_shapes;
  check(MatMatMult(mass, shapes, MAT_INITIAL_MATRIX, PETSC_DEFAULT, m_shapes.out()));
  {
    const LocalColumns phi(shapes);
    const LocalColumns m_phi(m_shapes);
    std::vector<double> squares(modes, 0.0);
    for (std::size_t j = 0; j < modes; ++j) {
      const auto c = static_cast<PetscInt>(j);
      for (PetscInt i = 0; i < phi.rows; ++i) squares[j] += phi.column(c)[i] * m_phi.column(c)[i];
    }
    MPI_Allreduce(MPI_IN_PLACE, squares.data(), static_cast<int>(modes), MPI_DOUBLE, MPI_SUM, comm);
    for (std::size_t j = 0; j < modes; ++j) {
      const double factor = 1 / std::sqrt(squares[j]);
      const auto c = static_cast<PetscInt>(j);
      for (PetscInt i = 0; i < phi.rows; ++i) {
        phi.column(c)[i] *= factor;
        m_phi.column(c)[i] *= factor;
      }
    }
    const std::vector<double> gram = calc_gram(comm, phi, m_phi);
    for (std::size_t j = 0; j < modes; ++j) {
      for (std::size_t i = 0; i < modes; ++i) {
        errors.orthonormality = std::max(errors.orthonormality, std::abs(gram[j * modes + i] - (i == j ? 1.0 : 0.0)));
      }
    }
  }
  petsc::MatHandle k_shapes;
  check(MatMatMult(stiffness, shapes, MAT_INITIAL_MATRIX, PETSC_DEFAULT, k_shapes.out()));
  petsc::VecHandle diagonal;
  check(MatCreateVecs(stiffness, nullptr, diagonal.out()));
  check(MatGetDiagonal(stiffness, diagonal));
  const PetscScalar* weight = nullptr;
  check(VecGetArrayRead(diagonal, &weight));
  std::vector<double> squares(3 * modes, 0.0);
  {
    const LocalColumns k_phi(k_shapes);
    const LocalColumns m_phi(m_shapes);
    const LocalColumns phi(shapes);
    for (std::size_t j = 0; j < modes; ++j) {
      const auto c = static_cast<PetscInt>(j);
      lambda[j] = std::inner_product(phi.column(c), phi.column(c) + phi.rows, k_phi.column(c), 0.0);
    }
    MPI_Allreduce(MPI_IN_PLACE, lambda.data(), static_cast<int>(modes), MPI_DOUBLE, MPI_SUM, comm);
    for (std::size_t j = 0; j < modes; ++j) {
      const auto c = static_cast<PetscInt>(j);
      for (PetscInt i = 0; i < k_phi.rows; ++i) {
        const double rest = k_phi.column(c)[i] - lambda[j] * m_phi.column(c)[i];
        const double term = weight[i] * phi.column(c)[i];
        squares[3 * j] += rest * rest;
        squares[3 * j + 1] += m_phi.column(c)[i] * m_phi.column(c)[i];
        squares[3 * j + 2] += term * term;
      }
    }
  }
  check(VecRestoreArrayRead(diagonal, &weight));
  MPI_Allreduce(MPI_IN_PLACE, squares.data(), static_cast<int>(squares.size()), MPI_DOUBLE, MPI_SUM, comm);
  for (std::size_t j = 0; j < modes; ++j) {
    const double scale = lambda[j] * std::sqrt(squares[3 * j + 1]);
    errors.residual.push_back(std::sqrt(squares[3 * j]) / scale);
    errors.floor.push_back(kRoundOff * PETSC_MACHINE_EPSILON * std::sqrt(squares[3 * j + 2]) / scale);
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
  petsc::MatHandle copy;
  check(MatDuplicate(shapes, MAT_COPY_VALUES, copy.out()));
  const LocalColumns from(copy);
  const LocalColumns to(shapes);
  for (std::size_t j = 0; j < order.size(); ++j) {
    std::copy_n(from.column(static_cast<PetscInt>(order[j])), from.rows, to.column(static_cast<PetscInt>(j)));
  }
}

void orthonormalise_shapes(Mat mass, Mat shapes) {
  MPI_Comm comm = MPI_COMM_NULL;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(mass), &comm));
  petsc::MatHandle m_shapes;
  check(MatMatMult(mass, shapes, MAT_INITIAL_MATRIX, PETSC_DEFAULT, m_shapes.out()));
  const LocalColumns phi(shapes);
  const LocalColumns m_phi(m_shapes);
  std::vector<double> gram = calc_gram(comm, phi, m_phi);
  PetscBLASInt rows = phi.rows;
  PetscBLASInt modes = phi.columns;
  PetscBLASInt stride = std::max(phi.stride, 1);
  PetscBLASInt info = 0;
  double one = 1;
  LAPACKpotrf_("U", &modes, gram.data(), &modes, &info);
  if (info != 0)
    throw SolveError(fmt::format("Mode {} is a combination of lower ones: it converged twice. Solve the band in parts.", info));
  if (rows > 0) BLAStrsm_("R", "U", "N", "N", &rows, &modes, &one, gram.data(), &modes, phi.values, &stride);
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
    for (PetscInt i = 0; i < phi.rows; ++i) largest[j] = std::max(largest[j], std::abs(column[i]));
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
