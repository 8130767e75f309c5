#include "precompute/la/node_rows.hpp"

#include <algorithm>

#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::la {

using petsc::check;

void NodeRows::Part::open(Mat sequential) {
  PetscInt count = 0;
  PetscBool done = PETSC_FALSE;
  check(MatGetRowIJ(sequential, 0, PETSC_FALSE, PETSC_FALSE, &count, &offsets, &columns, &done));
  if (done != PETSC_TRUE) throw SolveError("PETSc cannot return the rows of a matrix. Assemble it as AIJ.");
  matrix = sequential;
  check(MatSeqAIJGetArrayRead(sequential, &values));
}

void NodeRows::Part::close() {
  if (matrix == nullptr) return;
  PetscInt count = 0;
  PetscBool done = PETSC_FALSE;
  (void)MatSeqAIJRestoreArrayRead(matrix, &values);
  (void)MatRestoreRowIJ(matrix, 0, PETSC_FALSE, PETSC_FALSE, &count, &offsets, &columns, &done);
}

bool NodeRows::Part::has_blocks(PetscInt rows, const PetscInt* global) const {
  if (offsets == nullptr) return true;
  const auto number = [global](PetscInt column) { return global == nullptr ? column : global[column]; };
  for (PetscInt i = 0; i + 3 <= rows; i += 3) {
    const PetscInt* row = columns + offsets[i];
    const PetscInt length = offsets[i + 1] - offsets[i];
    if (length % 3 != 0) return false;
    for (PetscInt d = 1; d < 3; ++d)
      if (offsets[i + d + 1] - offsets[i + d] != length || !std::equal(row, row + length, columns + offsets[i + d])) return false;
    for (PetscInt k = 0; k < length; k += 3)
      if (number(row[k]) % 3 != 0 || number(row[k + 2]) != number(row[k]) + 2) return false;
  }
  return true;
}

NodeRows::NodeRows(Mat matrix) {
  PetscInt last = 0;
  check(MatGetOwnershipRange(matrix, &first_, &last));
  rows_ = last - first_;
  PetscBool is_parallel = PETSC_FALSE;
  PetscBool is_sequential = PETSC_FALSE;
  check(PetscObjectBaseTypeCompare(reinterpret_cast<PetscObject>(matrix), MATMPIAIJ, &is_parallel));
  check(PetscObjectBaseTypeCompare(reinterpret_cast<PetscObject>(matrix), MATSEQAIJ, &is_sequential));
  if (is_parallel == PETSC_TRUE) {
    Mat own = nullptr;
    Mat ghost = nullptr;
    check(MatMPIAIJGetSeqAIJ(matrix, &own, &ghost, &ghosts_));
    check(MatGetSize(ghost, nullptr, &ghost_count_));
    own_.open(own);
    ghost_.open(ghost);
  } else if (is_sequential == PETSC_TRUE) {
    own_.open(matrix);
  } else {
    throw InputError("K and M must be AIJ matrices. Convert them with MatConvert.");
  }
  has_blocks_ = rows_ % 3 == 0 && own_.has_blocks(rows_, nullptr) && ghost_.has_blocks(rows_, ghosts_);
}

NodeRows::~NodeRows() {
  own_.close();
  ghost_.close();
}

}  // namespace carillon::la
