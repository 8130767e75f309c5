// Method:     Cholesky of M, L^-1 K L^-T to tridiagonal form, divide and conquer. Every rank solves the same gathered matrices and keeps
//             its rows.
// Source:     Golub, Van Loan, Matrix Computations, sections 8.4 and 8.7; LAPACK's dsygvd (five times as fast as the QR of dsygv).
// Deviations: none.
#include "precompute/eigen/dense_modes.hpp"

#include <fmt/core.h>
#include <petscblaslapack.h>

#include "precompute/petsc/session.hpp"
#include "precompute/petsc/work.hpp"
#include "runtime/base/error.hpp"

// PETSc declares no dsygvd.
extern "C" void dsygvd_(const PetscBLASInt* type, const char* job, const char* half, const PetscBLASInt* n, double* a,
                        const PetscBLASInt* lda, double* b, const PetscBLASInt* ldb, double* lambda, double* work,
                        const PetscBLASInt* work_size, PetscBLASInt* integers, const PetscBLASInt* integers_size, PetscBLASInt* info);

namespace carillon::eigen {
namespace {

using petsc::check;

constexpr double kEigenFlops = 9;  // of n^3 at most: both matrices reduced, divide and conquer, vectors back (Golub, Van Loan, 8.3 to 8.7)

// The whole matrix, column-major, on every rank.
std::vector<double> gather_dense(Mat matrix, PetscInt n) {
  std::vector<double> dense(static_cast<std::size_t>(n) * static_cast<std::size_t>(n), 0.0);
  PetscInt first = 0;
  PetscInt last = 0;
  check(MatGetOwnershipRange(matrix, &first, &last));
  for (PetscInt row = first; row < last; ++row) {
    PetscInt count = 0;
    const PetscInt* columns = nullptr;
    const PetscScalar* values = nullptr;
    check(MatGetRow(matrix, row, &count, &columns, &values));
    for (PetscInt k = 0; k < count; ++k)
      dense[static_cast<std::size_t>(columns[k]) * static_cast<std::size_t>(n) + static_cast<std::size_t>(row)] = values[k];
    check(MatRestoreRow(matrix, row, &count, &columns, &values));
  }
  MPI_Comm comm = MPI_COMM_NULL;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(matrix), &comm));
  MPI_Allreduce(MPI_IN_PLACE, dense.data(), static_cast<int>(dense.size()), MPI_DOUBLE, MPI_SUM, comm);
  return dense;
}

}  // namespace

DensePairs solve_dense(Mat stiffness, Mat mass) {
  PetscInt n = 0;
  check(MatGetSize(stiffness, &n, nullptr));
  std::vector<double> k = gather_dense(stiffness, n);
  std::vector<double> m = gather_dense(mass, n);
  DensePairs pairs;
  pairs.lambda.resize(static_cast<std::size_t>(n));
  PetscBLASInt type = 1;
  PetscBLASInt size = n;
  PetscBLASInt info = 0;
  double best_size = 0;
  PetscBLASInt integers_size = 0;
  const PetscBLASInt ask = -1;
  dsygvd_(&type, "V", "L", &size, k.data(), &size, m.data(), &size, pairs.lambda.data(), &best_size, &ask, &integers_size, &ask, &info);
  const auto work_size = static_cast<PetscBLASInt>(best_size);
  std::vector<double> work(static_cast<std::size_t>(work_size));
  std::vector<PetscBLASInt> integers(static_cast<std::size_t>(integers_size));
  dsygvd_(&type, "V", "L", &size, k.data(), &size, m.data(), &size, pairs.lambda.data(), work.data(), &work_size, integers.data(),
          &integers_size, &info);
  petsc::add_flops(kEigenFlops * static_cast<double>(n) * n * n);
  if (info != 0) {
    throw SolveError(fmt::format("The dense eigensolver failed (LAPACK dsygvd: {}){}", info,
                                 info > n ? ": the mass matrix is not positive definite. Look for elements without volume." : "."));
  }
  MPI_Comm comm = MPI_COMM_NULL;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(stiffness), &comm));
  // All keep their rows of the same bits, whatever their processors make of the same input.
  for (PetscInt j = 0; j < n; ++j) MPI_Bcast(k.data() + static_cast<std::ptrdiff_t>(j) * n, n, MPI_DOUBLE, 0, comm);
  MPI_Bcast(pairs.lambda.data(), n, MPI_DOUBLE, 0, comm);
  PetscInt first = 0;
  PetscInt last = 0;
  check(MatGetOwnershipRange(stiffness, &first, &last));
  check(MatCreateDense(comm, last - first, PETSC_DECIDE, n, n, nullptr, pairs.vectors.out()));
  PetscScalar* own = nullptr;
  PetscInt stride = 0;
  check(MatDenseGetLDA(pairs.vectors, &stride));
  check(MatDenseGetArrayWrite(pairs.vectors, &own));
  for (PetscInt j = 0; j < n; ++j) {
    for (PetscInt row = first; row < last; ++row) {
      own[static_cast<std::size_t>(j) * static_cast<std::size_t>(stride) + static_cast<std::size_t>(row - first)] =
          k[static_cast<std::size_t>(j) * static_cast<std::size_t>(n) + static_cast<std::size_t>(row)];
    }
  }
  check(MatDenseRestoreArrayWrite(pairs.vectors, &own));
  check(MatAssemblyBegin(pairs.vectors, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(pairs.vectors, MAT_FINAL_ASSEMBLY));
  return pairs;
}

}  // namespace carillon::eigen
