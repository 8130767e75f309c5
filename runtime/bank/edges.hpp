// Edges of a triangle surface.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace carillon::bank {

/// Half-edge 3 t + k of triangle t: from its corner k to the next.
struct HalfEdge {
  std::int32_t upper = 0;   // the larger of its two vertices
  std::int32_t number = 0;  // 3 t + k
};

/// Calls take(lower, first, last) for each edge: its smaller vertex and its half-edges [first, last), in ascending order. Edges ascend by
/// smaller, then larger vertex. Corners must be below `vertices`. Bucket sort by the smaller vertex: linear time at low valence.
template <class Take>
void for_each_edge(const std::vector<std::array<std::int32_t, 3>>& triangles, std::size_t vertices, Take&& take) {
  constexpr std::int32_t kFew = 24;  // insertion sort below this
  std::vector<std::int32_t> next(vertices + 1, 0);
  for (const auto& corners : triangles)
    for (std::size_t k = 0; k < 3; ++k) ++next[std::min(corners[k], corners[(k + 1) % 3])];
  std::int32_t before = 0;
  for (std::int32_t& count : next) {
    const std::int32_t here = count;
    count = before;
    before += here;
  }
  std::vector<HalfEdge> edges(3 * triangles.size());
  std::int32_t number = 0;
  for (const auto& corners : triangles) {
    for (std::size_t k = 0; k < 3; ++k, ++number) {
      const std::int32_t a = corners[k], b = corners[(k + 1) % 3];
      edges[next[std::min(a, b)]++] = {std::max(a, b), number};
    }
  }
  // next[v] is now the end of bucket v.
  HalfEdge* const all = edges.data();
  std::int32_t begin = 0;
  for (std::size_t v = 0; v < vertices; ++v) {
    const std::int32_t end = next[v];
    if (end - begin <= kFew) {
      for (std::int32_t i = begin + 1; i < end; ++i) {
        const HalfEdge edge = all[i];
        std::int32_t j = i;
        for (; j > begin && all[j - 1].upper > edge.upper; --j) all[j] = all[j - 1];
        all[j] = edge;
      }
    } else {
      std::stable_sort(all + begin, all + end, [](const HalfEdge& a, const HalfEdge& b) { return a.upper < b.upper; });
    }
    for (std::int32_t first = begin, last = begin; first < end; first = last) {
      while (last < end && all[last].upper == all[first].upper) ++last;
      take(static_cast<std::int32_t>(v), all + first, all + last);
    }
    begin = end;
  }
}

}  // namespace carillon::bank
