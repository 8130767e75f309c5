#include "precompute/eigen/scaled_matrix.hpp"

#include "precompute/petsc/session.hpp"

namespace carillon::eigen {

using petsc::check;

ScaledMatrix::ScaledMatrix(Mat matrix, double factor) : matrix_(matrix), factor_(factor) {
  PetscInt rows = 0;
  PetscInt n = 0;
  check(MatGetLocalSize(matrix, &rows, nullptr));
  check(MatGetSize(matrix, &n, nullptr));
  check(MatCreateShell(petsc::get_communicator(matrix), rows, rows, n, n, this, shell_.out()));
  check(MatShellSetOperation(shell_, MATOP_MULT, reinterpret_cast<void (*)()>(multiply)));
  check(MatShellSetOperation(shell_, MATOP_MULT_TRANSPOSE, reinterpret_cast<void (*)()>(multiply)));  // symmetric
}

PetscErrorCode ScaledMatrix::multiply(Mat shell, Vec x, Vec y) {
  const ScaledMatrix* scaled = nullptr;
  PetscCall(MatShellGetContext(shell, &scaled));
  PetscCall(MatMult(scaled->matrix_, x, y));
  return VecScale(y, scaled->factor_);
}

}  // namespace carillon::eigen
