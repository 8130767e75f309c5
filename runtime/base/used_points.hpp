// Points referenced by triangles.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/base/triangle.hpp"

namespace carillon::base {

struct UsedPoints {
  std::vector<std::int32_t> points;  // ascending
  std::vector<std::int32_t> number;  // index of each point in `points`; -1: unused
};

/// `count`: number of all points.
inline UsedPoints find_used_points(std::span<const Triangle> triangles, std::size_t count) {
  UsedPoints used{{}, std::vector<std::int32_t>(count, -1)};
  for (const Triangle& triangle : triangles)
    for (const std::int32_t point : triangle) used.number[point] = 0;
  for (std::size_t point = 0; point < count; ++point)
    if (used.number[point] == 0) {
      used.number[point] = static_cast<std::int32_t>(used.points.size());
      used.points.push_back(static_cast<std::int32_t>(point));
    }
  return used;
}

}  // namespace carillon::base
