// View of the local rows of a distributed dense matrix.
#pragma once

#include <petscmat.h>

#include <cstddef>
#include <vector>

#include "precompute/la/block_kernels.hpp"

namespace carillon::la {

/// Local rows of a dense matrix, column-major. The matrix must outlive this object and must not be used otherwise meanwhile.
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

/// Moves column order[j] to place j, for all j; order: a permutation of the columns. Local.
void permute_columns(const Columns& columns, const std::vector<std::size_t>& order);

}  // namespace carillon::la
