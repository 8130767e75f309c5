// Overlapping pairs of boxes.
#pragma once

#include <algorithm>
#include <numeric>
#include <vector>

#include "runtime/physics/geometry/vectors.hpp"

namespace carillon::geometry {

/// Calls act(i, j) once for each pair of overlapping boxes, in any order (sweep and prune along the first axis).
template <typename Act>
void for_overlaps(const std::vector<Box>& boxes, Act&& act) {
  std::vector<int> order(boxes.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int x, int y) { return boxes[x].low[0] < boxes[y].low[0]; });
  for (auto i = order.begin(); i != order.end(); ++i)
    for (auto j = i + 1; j != order.end() && boxes[*j].low[0] <= boxes[*i].high[0]; ++j)
      if (boxes[*i].overlaps(boxes[*j])) act(*i, *j);
}

}  // namespace carillon::geometry
