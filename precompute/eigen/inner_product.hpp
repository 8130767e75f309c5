// M inner product of column blocks.
#pragma once

#include <petscmat.h>

#include <array>
#include <span>

#include "precompute/comm/communicator.hpp"
#include "precompute/la/block_kernels.hpp"
#include "precompute/petsc/handle.hpp"

namespace carillon::eigen {

using la::Columns;

/// A block W of `width` columns in memory owned by the caller, and Z = M W, valid from multiply() until W changes or moves.
class InnerProduct {
 public:
  /// mass: M (n, n) with `rows` rows on this rank; null: the identity. diagonal: (rows) where M has nothing else, and must outlive it; null
  /// where it has. Collective.
  InnerProduct(const comm::Communicator& comm, Mat mass, PetscInt rows, PetscInt n, int width, const double* diagonal = nullptr);
  ~InnerProduct();
  InnerProduct(const InnerProduct&) = delete;
  InnerProduct& operator=(const InnerProduct&) = delete;

  /// W becomes the first `width` columns of `memory`, which must be contiguous.
  void place(const Columns& memory);
  /// Z = M W. Collective.
  void multiply();

  const Columns& w() const { return w_; }
  const Columns& z() const { return z_; }
  Mat w_mat() const { return w_mat_; }
  Mat z_mat() const { return z_mat_; }
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
  int width_;
  petsc::MatHandle mass_, w_mat_, z_mat_;
  Columns w_, z_;
  const double* diagonal_;
  bool is_placed_ = false;
};

}  // namespace carillon::eigen
