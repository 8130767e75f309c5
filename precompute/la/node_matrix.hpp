// A distributed matrix of 3 x 3 node blocks times many columns.
#pragma once

#include <petscmat.h>
#include <petscsf.h>

#include <cstdint>
#include <vector>

#include "precompute/la/block_kernels.hpp"
#include "precompute/petsc/handle.hpp"

namespace carillon::la {

/// K or M by nodes: 3 x 3 blocks, or one number per node pair if every block is a multiple of the identity (M), or a diagonal. Products use
/// strips of sixteen columns with the values of a node adjacent; values of other ranks are fetched once per strip.
class NodeMatrix {
 public:
  static constexpr int kStrip = 16;

  /// A row of sixteen columns.
  struct alignas(64) Row {
    double column[kStrip];
  };

  /// Copies `factor` times the matrix: AIJ, rows in blocks of three, whole nodes per rank. Collective.
  explicit NodeMatrix(Mat matrix, double factor = 1);

  /// y = A x for all columns; x and y: rows of this rank, must not overlap. Collective.
  void multiply(const Columns& x, const Columns& y) const;

  /// Columns first ... first + 15 of x, padded by zeros, row-major, followed by the rows of other ranks: input of multiply_rows.
  /// Collective.
  void pack(const Columns& x, int first, std::vector<Row>& packed) const;

  /// y (3 nodes): rows of A x of `nodes` own nodes from `begin` on.
  void multiply_rows(const Row* packed, std::size_t begin, std::size_t nodes, Row* y) const;

  /// Copies the rows of such a product into the columns of y, at most sixteen.
  static void unpack(const Row* rows, std::size_t begin, std::size_t nodes, const Columns& y);

  bool is_diagonal() const { return kind_ == Kind::kDiagonal; }
  /// (rows) the diagonal if the matrix is diagonal, otherwise null.
  const double* get_diagonal() const { return is_diagonal() ? diagonal_.data() : nullptr; }

 private:
  enum class Kind { kDiagonal, kScalars, kBlocks };
  void read(Mat matrix, double factor);
  /// Row sums of the blocks, zero if within rounding.
  void sum_rows();
  void plan_exchange(Mat matrix, const std::vector<PetscInt>& ghosts);

  Kind kind_ = Kind::kDiagonal;
  std::size_t nodes_ = 0;                // own
  std::size_t ghosts_ = 0;               // nodes of other ranks in own rows
  std::vector<double> diagonal_;         // (3 nodes), kDiagonal
  std::vector<std::int64_t> start_;      // (nodes + 1) into neighbour_
  std::vector<std::int32_t> neighbour_;  // own nodes first, then ghosts
  std::vector<double> values_;           // one or nine (row by row) per neighbour
  std::vector<double> rest_;             // (nodes, 9), kBlocks: row sum of the blocks
  petsc::Handle<PetscSF, PetscSFDestroy> exchange_;
};

}  // namespace carillon::la
