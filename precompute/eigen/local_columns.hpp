// A distributed dense matrix as the columns of this rank's rows, and the products of such columns.
#pragma once

#include <petscmat.h>

#include <cstddef>
#include <vector>

namespace carillon::eigen {

/// A dense matrix's own rows, column-major. The matrix must outlive it and belongs to it while it lives.
struct LocalColumns {
  explicit LocalColumns(Mat dense);
  ~LocalColumns();
  LocalColumns(const LocalColumns&) = delete;
  LocalColumns& operator=(const LocalColumns&) = delete;
  double* column(PetscInt j) const { return values + static_cast<std::size_t>(j) * static_cast<std::size_t>(stride); }

  Mat mat = nullptr;
  PetscScalar* values = nullptr;
  PetscInt rows = 0;
  PetscInt columns = 0;
  PetscInt stride = 0;
};

/// A^T B over all ranks, (a.columns, b.columns) column-major. Collective.
std::vector<double> calc_gram(MPI_Comm comm, const LocalColumns& a, const LocalColumns& b);

/// out = a * small, small: (a.columns, out.columns) column-major. Local.
void multiply_columns(const LocalColumns& a, const std::vector<double>& small, const LocalColumns& out);

}  // namespace carillon::eigen
