// Products of tall blocks of columns, the bulk of the orthogonalisation.
#pragma once

#include <mpi.h>

#include <cstddef>

#include "precompute/comm/communicator.hpp"
#include "precompute/la/lapack.hpp"

namespace carillon::la {

/// Columns of this rank's rows, column-major; does not own them.
struct Columns {
  double* values = nullptr;
  std::ptrdiff_t rows = 0;
  std::ptrdiff_t stride = 0;  // from one column to the next, at least rows
  int count = 0;

  double* column(int j) const { return values + static_cast<std::ptrdiff_t>(j) * stride; }
  Columns part(int first, int number) const { return {column(first), rows, stride, number}; }
};

/// small = A^T B of this rank's rows, (a.count, b.count) column-major with stride `small_stride`. Not collective: the caller sums over the
/// ranks.
void multiply_transposed(const Columns& a, const Columns& b, double* small, int small_stride);

/// The same of all ranks' rows. Collective.
Matrix multiply_transposed(const comm::Communicator& comm, const Columns& a, const Columns& b);

/// B <- B - A S, S: (a.count, b.count) column-major with stride `small_stride`. Not collective.
void subtract_product(const Columns& a, const double* small, int small_stride, const Columns& b);

/// The first `kept` columns of A <- A S, S: (a.count, kept) column-major with stride a.count. Not collective.
void combine_columns(const Columns& a, const double* small, int kept);

}  // namespace carillon::la
