// Connected groups: union-find.
#pragma once

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <utility>
#include <vector>

namespace carillon::base {

/// Disjoint groups of the numbers 0 ... count - 1 (union-find). A group is represented by its smallest number.
class Groups {
 public:
  explicit Groups(int count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0); }
  /// The smallest number in the group of `i`.
  int find(int i) {
    while (at(i) != i) i = at(i) = at(at(i));
    return i;
  }
  void join(int i, int j) {
    const auto [low, high] = std::minmax({find(i), find(j)});
    at(high) = low;
  }

 private:
  int& at(int i) { return parent_[i]; }
  std::vector<int> parent_;
};

}  // namespace carillon::base
