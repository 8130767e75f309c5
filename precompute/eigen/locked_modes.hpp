// Known eigenvectors that an iteration stays orthogonal to.
#pragma once

#include <mpi.h>

#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/la/block_kernels.hpp"

namespace carillon::eigen {

using la::Columns;

/// Columns [first, first + count) of the locked modes.
struct LockedRange {
  int first = 0;
  int count = 0;
};

/// References to M-orthonormal columns (rows of this rank) owned by others, and their eigenvalues.
struct LockedModes {
  std::vector<Columns> sets;
  std::vector<double> lambda;  // of all columns, set by set

  int count() const { return static_cast<int>(lambda.size()); }
  LockedRange all() const { return {0, count()}; }
  /// The columns of a range, one part per set.
  std::vector<Columns> find_parts(LockedRange range) const;
  /// L^T B summed over all ranks for a range of columns of L, (range.count, b.count). Collective.
  la::Matrix multiply_transposed(const comm::Communicator& comm, LockedRange range, const Columns& b) const;
  /// B <- B - L S for a range, S: (range.count, b.count). Local.
  void subtract_product(LockedRange range, const la::Matrix& s, const Columns& b) const;
  /// B <- B - L (L^T Z), Z = M B; returns L^T Z. Collective.
  la::Matrix project_out(const comm::Communicator& comm, LockedRange range, const Columns& b, const Columns& z) const;

 private:
  template <class Visit>
  void for_parts(LockedRange range, const Visit& visit) const;
};

}  // namespace carillon::eigen
