// Method: Cholesky of M, L^-1 K L^-T to tridiagonal form, divide and conquer. Rank 0 solves the gathered matrices; every rank keeps its
// rows of the result.
// Source: Golub, Van Loan, Matrix Computations, sections 8.4 and 8.7; LAPACK dsygvd (five times as fast as the QR of dsygv).
#include "precompute/eigen/dense_modes.hpp"

#include <fmt/core.h>

#include <algorithm>

#include "precompute/la/lapack.hpp"
#include "precompute/la/local_columns.hpp"
#include "precompute/petsc/session.hpp"
#include "precompute/petsc/work.hpp"
#include "runtime/base/error.hpp"

namespace carillon::eigen {
namespace {

using la::LocalColumns;
using petsc::check;

constexpr double kEigenFlops =
    9;  // times n^3 at most: reduction of both matrices, divide and conquer, back-transformation (Golub, Van Loan, 8.3 to 8.7)

// `factor` times the whole matrix, on every rank.
la::Matrix gather_dense(Mat matrix, double factor, PetscInt n) {
  const comm::Communicator comm = petsc::get_communicator(matrix);
  la::Matrix dense = comm.agree([&] { return la::Matrix(la::Matrix::Zero(n, n)); });
  PetscInt first = 0;
  PetscInt last = 0;
  check(MatGetOwnershipRange(matrix, &first, &last));
  for (PetscInt row = first; row < last; ++row) {
    PetscInt count = 0;
    const PetscInt* columns = nullptr;
    const PetscScalar* values = nullptr;
    check(MatGetRow(matrix, row, &count, &columns, &values));
    for (PetscInt k = 0; k < count; ++k) dense(row, columns[k]) = factor * values[k];
    check(MatRestoreRow(matrix, row, &count, &columns, &values));
  }
  comm.sum(la::entries(dense));
  return dense;
}

}  // namespace

DensePairs solve_dense(const la::Pencil& pencil) {
  const Mat stiffness = pencil.stiffness;
  PetscInt n = 0;
  check(MatGetSize(stiffness, &n, nullptr));
  la::Matrix k = gather_dense(stiffness, pencil.stiffness_factor, n);
  la::Matrix m = gather_dense(pencil.mass, pencil.mass_factor, n);
  la::Vector lambda(n);
  const comm::Communicator comm = petsc::get_communicator(stiffness);
  comm.agree([&] {
    if (!comm.is_root()) return;
    const int info = la::calc_generalised_eigenpairs_by_division(k, m, lambda);
    petsc::add_flops(kEigenFlops * static_cast<double>(n) * n * n);
    if (info != 0) {
      throw SolveError(fmt::format("The dense eigensolver failed (LAPACK dsygvd: {}){}", info,
                                   info > n ? ": the mass matrix is not positive definite. Look for elements without volume." : "."));
    }
  });
  m.resize(0, 0);
  comm.broadcast_into(la::entries(k));
  comm.broadcast_into(la::entries(lambda));
  PetscInt first = 0;
  PetscInt last = 0;
  check(MatGetOwnershipRange(stiffness, &first, &last));
  DensePairs pairs;
  pairs.lambda.assign(lambda.begin(), lambda.end());
  check(MatCreateDense(comm, last - first, PETSC_DECIDE, n, n, nullptr, pairs.vectors.out()));
  {
    const LocalColumns own(pairs.vectors);
    for (PetscInt j = 0; j < n; ++j) std::copy_n(k.col(j).data() + first, last - first, own.column(j));
  }
  check(MatAssemblyBegin(pairs.vectors, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(pairs.vectors, MAT_FINAL_ASSEMBLY));
  return pairs;
}

}  // namespace carillon::eigen
