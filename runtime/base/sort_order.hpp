// Sorting permutation.
#pragma once

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

namespace carillon::base {

/// Indices in ascending order of the values; stable.
template <typename T>
std::vector<std::size_t> find_sort_order(const std::vector<T>& values) {
  std::vector<std::size_t> order(values.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return values[a] < values[b]; });
  return order;
}

}  // namespace carillon::base
