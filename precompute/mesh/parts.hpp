// Union-find: connected components.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace carillon::mesh {

/// Disjoint sets of nodes or triangles; find() uses path halving.
class Parts {
 public:
  explicit Parts(std::size_t count) : parent_(count) {
    for (std::size_t i = 0; i < count; ++i) parent_[i] = static_cast<std::int32_t>(i);
  }
  std::int32_t find(std::int32_t i) {
    while (parent_[i] != i) {
      auto& up = parent_[i];
      up = parent_[up];
      i = up;
    }
    return i;
  }
  /// The smaller number is the representative.
  void join(std::int32_t i, std::int32_t j) {
    i = find(i);
    j = find(j);
    if (i < j) parent_[j] = i;
    if (j < i) parent_[i] = j;
  }

 private:
  std::vector<std::int32_t> parent_;
};

}  // namespace carillon::mesh
