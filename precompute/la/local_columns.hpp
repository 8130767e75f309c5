// A distributed dense matrix as the columns of this rank's rows.
#pragma once

#include <petscmat.h>

#include <cstddef>
#include <vector>

#include "precompute/la/block_kernels.hpp"

namespace carillon::la {

/// A dense matrix's own rows, column-major. The matrix must outlive it and belongs to it while it lives.
struct LocalColumns {
  explicit LocalColumns(Mat dense);
  ~LocalColumns();
  LocalColumns(const LocalColumns&) = delete;
  LocalColumns& operator=(const LocalColumns&) = delete;
  Columns view() const { return {values, rows, stride, static_cast<int>(columns)}; }
  double* column(PetscInt j) const { return values + static_cast<std::size_t>(j) * static_cast<std::size_t>(stride); }

  Mat mat = nullptr;
  PetscScalar* values = nullptr;
  PetscInt rows = 0;
  PetscInt columns = 0;
  PetscInt stride = 0;
};

/// PETSc takes the values for changed from here on: they were written through pointers of their own. Local.
void mark_changed(Mat dense);

/// Puts column order[j] at place j, for all j; order: a permutation of the columns. Local.
void permute_columns(const Columns& columns, const std::vector<std::size_t>& order);

}  // namespace carillon::la
