#include "precompute/eigen/local_columns.hpp"

#include <petscblaslapack.h>

#include <algorithm>

#include "precompute/petsc/session.hpp"

namespace carillon::eigen {

using petsc::check;

LocalColumns::LocalColumns(Mat dense) : mat(dense) {
  PetscInt first = 0;
  PetscInt last = 0;
  check(MatGetOwnershipRange(dense, &first, &last));
  check(MatGetSize(dense, nullptr, &columns));
  check(MatDenseGetLDA(dense, &stride));
  rows = last - first;
  check(MatDenseGetArray(dense, &values));
}

LocalColumns::~LocalColumns() { (void)MatDenseRestoreArray(mat, &values); }

std::vector<double> calc_gram(MPI_Comm comm, const LocalColumns& a, const LocalColumns& b) {
  std::vector<double> gram(static_cast<std::size_t>(a.columns) * static_cast<std::size_t>(b.columns), 0.0);
  PetscBLASInt m = a.columns;
  PetscBLASInt n = b.columns;
  PetscBLASInt k = a.rows;
  PetscBLASInt lda = std::max(a.stride, 1);
  PetscBLASInt ldb = std::max(b.stride, 1);
  double one = 1;
  double zero = 0;
  if (k > 0) BLASgemm_("T", "N", &m, &n, &k, &one, a.values, &lda, b.values, &ldb, &zero, gram.data(), &m);
  MPI_Allreduce(MPI_IN_PLACE, gram.data(), static_cast<int>(gram.size()), MPI_DOUBLE, MPI_SUM, comm);
  return gram;
}

void multiply_columns(const LocalColumns& a, const std::vector<double>& small, const LocalColumns& out) {
  PetscBLASInt m = a.rows;
  PetscBLASInt n = out.columns;
  PetscBLASInt k = a.columns;
  PetscBLASInt lda = std::max(a.stride, 1);
  PetscBLASInt ldc = std::max(out.stride, 1);
  double one = 1;
  double zero = 0;
  if (m > 0) BLASgemm_("N", "N", &m, &n, &k, &one, a.values, &lda, small.data(), &k, &zero, out.values, &ldc);
}

}  // namespace carillon::eigen
