// Basis of a block Lanczos iteration and the projected operator.
#pragma once

#include <utility>

#include "precompute/la/block_kernels.hpp"

namespace carillon::eigen {

using la::Columns;

/// Krylov relation A^-1 M V = V T + V_next R E^T, E: the last width() columns of the identity. T is symmetric and block tridiagonal (after
/// a restart: an arrow, then block tridiagonal), R is upper triangular until a restart, V_next is the block behind V. set_diagonal() and
/// set_coupling() complete the relation for the last block; append() and restart() preserve it.
class LanczosBasis {
 public:
  /// memory: room + block contiguous columns.
  LanczosBasis(const Columns& memory, int room, int block);

  int room() const { return room_; }
  int block() const { return block_; }
  int size() const { return size_; }          // columns of V
  int width() const { return width_; }        // of its last block
  int previous() const { return previous_; }  // first column of the block that the last block is coupled to
  int next_width() const { return static_cast<int>(coupling_.rows()); }
  bool is_full() const { return size_ + next_width() > room_; }

  /// Columns of V and of the blocks behind it.
  Columns columns(int first, int count) const { return memory_.part(first, count); }
  Columns all() const { return columns(0, size_); }

  const la::Matrix& t() const { return t_; }                // (room, room), of which the first size() rows and columns count
  const la::Matrix& coupling() const { return coupling_; }  // R, (next_width, width)

  /// V becomes its first block of `width` columns.
  void start(int width);
  /// Sets the diagonal block of T for the last block of V to the symmetric part of alpha, (width, width).
  void set_diagonal(const la::Matrix& alpha);
  void set_coupling(la::Matrix r) { coupling_ = std::move(r); }
  /// V_next becomes the last block of V.
  void append();
  /// V becomes V Y and T becomes diag(theta): Y (size, kept) are eigenvectors of T, theta their eigenvalues. V_next moves behind it.
  void restart(const la::Vector& theta, const la::Matrix& y);
  /// Restores a saved state: V, `size` columns already in place, and T (size, size).
  void resume(int size, int width, int previous, const la::Matrix& t);

 private:
  Columns memory_;
  int room_;
  int block_;
  int size_ = 0;
  int width_ = 0;
  int previous_ = 0;
  la::Matrix t_;
  la::Matrix coupling_;
};

}  // namespace carillon::eigen
