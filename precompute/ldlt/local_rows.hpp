// This rank's rows of a PETSc AIJ matrix, by plain arrays.
#pragma once

#include <petscmat.h>

namespace carillon::ldlt {

/// Row i has its entries in columns of this rank (numbered from first_row) and of others (numbers to be looked up in `ghosts`). Borrows the
/// matrix while it lives. Throws InputError when the matrix is not AIJ.
class LocalRows {
 public:
  explicit LocalRows(Mat matrix);
  ~LocalRows();
  LocalRows(const LocalRows&) = delete;
  LocalRows& operator=(const LocalRows&) = delete;

  PetscInt first_row() const { return first_; }
  PetscInt rows() const { return rows_; }
  PetscInt ghost_count() const { return ghost_count_; }
  const PetscInt* ghosts() const { return ghosts_; }  // (ghost_count) global columns, ascending

  /// Calls own(column, value) and ghost(column, value) for the entries of row i, columns ascending in each.
  template <typename Own, typename Ghost>
  void visit(PetscInt i, Own&& own, Ghost&& ghost) const {
    for (PetscInt k = own_.offsets[i]; k < own_.offsets[i + 1]; ++k) own(own_.columns[k], own_.values[k]);
    if (ghost_.offsets == nullptr) return;
    for (PetscInt k = ghost_.offsets[i]; k < ghost_.offsets[i + 1]; ++k) ghost(ghost_.columns[k], ghost_.values[k]);
  }

 private:
  struct Part {
    Mat matrix = nullptr;
    const PetscInt* offsets = nullptr;
    const PetscInt* columns = nullptr;
    const PetscScalar* values = nullptr;
    void open(Mat sequential);
    void close();
  };
  PetscInt first_ = 0;
  PetscInt rows_ = 0;
  PetscInt ghost_count_ = 0;
  const PetscInt* ghosts_ = nullptr;
  Part own_;
  Part ghost_;
};

}  // namespace carillon::ldlt
