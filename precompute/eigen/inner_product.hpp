// M inner product of column blocks.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/la/block_kernels.hpp"
#include "precompute/la/node_matrix.hpp"

namespace carillon::eigen {

using la::Columns;

/// A block W of `width` columns in memory owned by the caller, and Z = M W, valid from multiply() until W changes or moves.
class InnerProduct {
 public:
  /// mass: must outlive this object. rows: of this rank.
  InnerProduct(const comm::Communicator& comm, const la::NodeMatrix& mass, std::ptrdiff_t rows, int width);
  InnerProduct(const InnerProduct&) = delete;
  InnerProduct& operator=(const InnerProduct&) = delete;

  /// W becomes the first `width` columns of `memory`, which must be contiguous.
  void place(const Columns& memory) { w_ = memory.part(0, width_); }
  /// Z = M W. Collective.
  void multiply() { mass_.multiply(w_, z_); }

  const Columns& w() const { return w_; }
  const Columns& z() const { return z_; }
  const comm::Communicator& comm() const { return comm_; }

  /// A^T B summed over all ranks, (a.count, b.count). Collective.
  la::Matrix calc_products(const Columns& a, const Columns& b) const { return la::multiply_transposed(comm_, a, b); }

  /// On the first `count` columns of W: W <- W - A S; returns C^T M W summed over all ranks, the sets of C stacked. W may be one of the
  /// sets. `sums` are summed in the same message. Collective.
  la::Matrix subtract_and_calc_products(const la::Product& product, int s_stride, std::span<const Columns> c, int count,
                                        std::array<double, 2>& sums);
  /// W <- (W - sum of the products) T, Z = M W; T: (count, count), null: the identity. Collective.
  void subtract_and_combine(std::span<const la::Product> products, int s_stride, const double* t, int count);

 private:
  comm::Communicator comm_;
  const la::NodeMatrix& mass_;
  int width_;
  std::vector<double> space_;  // of Z
  Columns w_, z_;
};

}  // namespace carillon::eigen
