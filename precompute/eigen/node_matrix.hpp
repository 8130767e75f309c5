// A distributed matrix of 3 x 3 node blocks times many columns.
#pragma once

#include <petscmat.h>
#include <petscsf.h>

#include <cstdint>
#include <vector>

#include "precompute/eigen/block_kernels.hpp"
#include "precompute/petsc/handle.hpp"

namespace carillon::eigen {

/// K or M by nodes: 3 x 3 blocks, or one number per node pair where every block is a multiple of the identity (M), or a diagonal. Sixteen
/// columns go at a time, their values at a node side by side; the values that other ranks own are fetched once for all sixteen.
class NodeMatrix {
 public:
  static constexpr int kStrip = 16;

  /// Copies the matrix: AIJ, rows in blocks of three, whole nodes per rank. Collective.
  explicit NodeMatrix(Mat matrix);

  /// y = A x for all columns; x and y: this rank's rows, must not overlap. Collective.
  void multiply(const Columns& x, const Columns& y) const;

  bool is_diagonal() const { return kind_ == Kind::kDiagonal; }

 private:
  enum class Kind { kDiagonal, kScalars, kBlocks };
  void read(Mat matrix);
  void plan_exchange(Mat matrix, const std::vector<PetscInt>& ghosts);
  void multiply_strip(const double* x, double* y) const;

  Kind kind_ = Kind::kDiagonal;
  std::size_t nodes_ = 0;                // own
  std::size_t ghosts_ = 0;               // nodes of other ranks in own rows
  std::vector<double> diagonal_;         // (3 nodes), kDiagonal
  std::vector<std::int64_t> start_;      // (nodes + 1) into neighbour_
  std::vector<std::int32_t> neighbour_;  // own nodes first, then ghosts
  std::vector<double> values_;           // one or nine (row by row) per neighbour
  petsc::Handle<PetscSF, PetscSFDestroy> exchange_;
};

}  // namespace carillon::eigen
