// Sharp convex edges of a surface, to tell faces, edges and corners apart.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "runtime/base/vector.hpp"

namespace carillon::drive {

/// Edges near a contact point. A rim has the curvature of its curved surface at any tilt, as in rigid contact.
struct NearEdges {
  int directions = 0;       // of edges between flat facets: 0 on a face, 1 on an edge, 2 at a corner
  Vec3 rim_m{}, outward{};  // nearest point of a rim, and the normal of the curved surface there; zeros: none
};

/// Edges between facets that differ by more than 25 degrees, in a grid. Immutable.
class SharpEdges {
 public:
  SharpEdges(std::span<const Vec3> vertices_m, std::span<const std::array<std::int32_t, 3>> triangles, double size_m);

  /// Edges within 1 % of the size of a contact point [m].
  NearEdges find_near(const Vec3& point_m) const;
  /// Corners of flat faces [m]; empty for a body with more than 64.
  std::span<const Vec3> get_corners() const { return corners_; }

 private:
  struct Edge {
    Vec3 begin{}, end{};
    Vec3 outward{};  // normal of its facet on a curved surface; zero: none
  };
  using Cell = std::array<std::int64_t, 3>;
  struct Hash {
    std::size_t operator()(const Cell& cell) const noexcept;
  };
  Cell find_cell(const Vec3& x) const;
  void add(const Edge& edge);
  void find_corners();

  double near_m_;
  std::vector<Edge> edges_;
  std::vector<Vec3> corners_;
  std::unordered_map<Cell, std::vector<int>, Hash> cells_;  // edges within near_m_ of the cell
};

}  // namespace carillon::drive
