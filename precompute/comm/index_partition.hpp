// Numbers 0 ... total - 1, contiguous per rank.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "precompute/comm/communicator.hpp"

namespace carillon::comm {

/// Ownership of numbers: rank r owns begin(r) ... begin(r + 1) - 1, from 0 to total(). The same on every rank except for members named
/// "own".
class IndexPartition {
 public:
  IndexPartition() = default;  // no numbers, no ranks
  /// Run lengths given by each rank. Collective.
  IndexPartition(const Communicator& comm, std::int64_t own_count);
  /// Equal run lengths, differing by at most one; longer runs first. Local.
  static IndexPartition make_even(const Communicator& comm, std::int64_t total);

  std::int64_t total() const { return begin_.empty() ? 0 : begin_.back(); }
  /// 0 <= rank <= ranks.
  std::int64_t begin(int rank) const { return begin_[rank]; }
  /// Pre: 0 <= number < total().
  int find_owner(std::int64_t number) const {
    return static_cast<int>(std::upper_bound(begin_.begin(), begin_.end(), number) - begin_.begin()) - 1;
  }

  std::int64_t own_begin() const { return begin(rank_); }
  std::int64_t own_end() const { return begin(rank_ + 1); }
  std::int64_t own_count() const { return own_end() - own_begin(); }
  bool is_own(std::int64_t number) const { return number >= own_begin() && number < own_end(); }
  /// Index of an own number in this rank's run.
  std::size_t to_local(std::int64_t number) const { return number - own_begin(); }

 private:
  std::vector<std::int64_t> begin_;  // (ranks + 1), ascending from 0
  int rank_ = 0;
};

}  // namespace carillon::comm
