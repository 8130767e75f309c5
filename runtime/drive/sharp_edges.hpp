// Sharp convex edges of a surface, to tell faces, edges and corners apart.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "runtime/base/vector.hpp"

namespace carillon::drive {

/// Edges between facets that differ by more than 25 degrees, in a grid. Immutable.
class SharpEdges {
 public:
  SharpEdges(std::span<const Vec3> vertices_m, std::span<const std::array<std::int32_t, 3>> triangles, double size_m);

  /// Number of directions of edges near a contact point [m] (1 % of the size): 0 on a face, 1 on an edge, 2 at a corner. outward: contact
  /// normal. At its rims a tube that lies flat counts as a face, a box at its corners does not.
  int count_directions(const Vec3& point_m, const Vec3& outward) const;

 private:
  struct Edge {
    Vec3 begin{}, end{};
    std::array<Vec3, 2> normals{}, off{};  // of its facets on curved surfaces; directions in them out over the edge
  };
  using Cell = std::array<std::int64_t, 3>;
  struct Hash {
    std::size_t operator()(const Cell& cell) const noexcept;
  };
  Cell find_cell(const Vec3& x) const;
  void add(const Edge& edge);

  double near_m_;
  std::vector<Edge> edges_;
  std::unordered_map<Cell, std::vector<int>, Hash> cells_;  // edges within near_m_ of the cell
};

}  // namespace carillon::drive
