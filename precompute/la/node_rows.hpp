// Plain-array access to this rank's rows of a PETSc AIJ matrix.
#pragma once

#include <petscmat.h>

namespace carillon::la {

/// Row i has entries in columns of this rank (numbered from first_row) and of others (indices into `ghosts`). The matrix must outlive this
/// object. Throws InputError if the matrix is not AIJ.
class NodeRows {
 public:
  explicit NodeRows(Mat matrix);
  ~NodeRows();
  NodeRows(const NodeRows&) = delete;
  NodeRows& operator=(const NodeRows&) = delete;

  PetscInt first_row() const { return first_; }
  PetscInt rows() const { return rows_; }
  PetscInt ghost_count() const { return ghost_count_; }
  const PetscInt* ghosts() const { return ghosts_; }  // (ghost_count) global columns, ascending

  /// True if all entries lie in 3x3 blocks of whole nodes.
  bool has_blocks() const { return has_blocks_; }

  /// Calls own(column, values) and ghost(column, values) for the blocks in the rows of a node (if has_blocks()), with the first column and
  /// pointers to the three rows of the block.
  template <typename Own, typename Ghost>
  void visit_blocks(PetscInt node, Own&& own, Ghost&& ghost) const {
    own_.visit_blocks(node, own);
    if (ghost_.offsets != nullptr) ghost_.visit_blocks(node, ghost);
  }

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
    template <typename Visit>
    void visit_blocks(PetscInt node, Visit&& visit) const {
      const PetscInt* rows = offsets + 3 * static_cast<std::ptrdiff_t>(node);
      for (PetscInt k = 0; k < rows[1] - rows[0]; k += 3) {
        const double* const parts[3] = {values + rows[0] + k, values + rows[1] + k, values + rows[2] + k};
        visit(columns[rows[0] + k], parts);
      }
    }
    /// global: numbers of the columns; null: identity.
    bool has_blocks(PetscInt rows, const PetscInt* global) const;
    void open(Mat sequential);
    void close();
  };
  PetscInt first_ = 0;
  PetscInt rows_ = 0;
  PetscInt ghost_count_ = 0;
  const PetscInt* ghosts_ = nullptr;
  bool has_blocks_ = false;
  Part own_;
  Part ghost_;
};

}  // namespace carillon::la
