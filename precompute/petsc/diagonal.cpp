#include "precompute/petsc/diagonal.hpp"

#include "precompute/petsc/handle.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::petsc {

std::vector<double> read_diagonal(Mat matrix) {
  const comm::Communicator comm = get_communicator(matrix);
  VecHandle diagonal;
  check(MatCreateVecs(matrix, nullptr, diagonal.out()));
  check(MatGetDiagonal(matrix, diagonal));
  PetscInt rows = 0;
  check(VecGetLocalSize(diagonal, &rows));
  std::vector<double> copy;
  comm.agree([&] { copy.reserve(rows); });
  const PetscScalar* values = nullptr;
  check(VecGetArrayRead(diagonal, &values));
  copy.assign(values, values + rows);
  check(VecRestoreArrayRead(diagonal, &values));
  return copy;
}

}  // namespace carillon::petsc
