// Products of tall column blocks, which dominate the orthogonalisation.
#pragma once

#include <mpi.h>

#include <cstddef>
#include <span>

#include "precompute/comm/communicator.hpp"
#include "precompute/la/lapack.hpp"

namespace carillon::la {

/// View of columns over this rank's rows, column-major.
struct Columns {
  double* values = nullptr;
  std::ptrdiff_t rows = 0;
  std::ptrdiff_t stride = 0;  // distance between columns, at least rows
  int count = 0;

  double* column(int j) const { return values + static_cast<std::ptrdiff_t>(j) * stride; }
  Columns part(int first, int number) const { return {column(first), rows, stride, number}; }
};

/// small = A^T B of this rank's rows, (a.count, b.count) column-major with stride `small_stride`. Not collective: the caller sums over the
/// ranks.
void multiply_transposed(const Columns& a, const Columns& b, double* small, int small_stride);

/// The same summed over all ranks. Collective.
Matrix multiply_transposed(const comm::Communicator& comm, const Columns& a, const Columns& b);

/// B <- B - A S, S: (a.count, b.count) column-major with stride `small_stride`. Not collective.
void subtract_product(const Columns& a, const double* small, int small_stride, const Columns& b);

/// A S, S: (a.count, any) column-major with a stride given by the call.
struct Product {
  Columns a;
  const double* s = nullptr;
};

/// B <- B - A S, then small = C^T D B for all sets of C, stacked, (all, b.count) column-major with stride `small_stride`; D: diagonal,
/// (b.rows). B may be one of C. Every number is read from memory once: B changes by panels of rows, which are multiplied while in the
/// cache. Not collective.
void subtract_and_multiply_transposed(const Product& product, int s_stride, const double* d, const Columns& b, std::span<const Columns> c,
                                      double* small, int small_stride);

/// B <- (B - sum of the products) T, then Z = D B, in one pass likewise. T: (b.count, b.count), null: the identity. Not collective.
void subtract_and_combine(std::span<const Product> products, int s_stride, const double* t, const double* d, const Columns& b,
                          const Columns& z);

/// The first `kept` columns of A <- A S, S: (a.count, kept) column-major with stride a.count. Not collective.
void combine_columns(const Columns& a, const double* small, int kept);

}  // namespace carillon::la
