// Classifies the edges of a triangle surface: edges of the body, or facet edges of a smooth surface.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Edge of the triangles.
struct Bend {
  std::array<std::int32_t, 2> ends{};         // points, ascending
  std::array<std::int32_t, 2> faces{-1, -1};  // triangles
  int count = 0;                              // of triangles; 2 on a closed surface
  double turn_deg = 180;
  double sign = 1;        // 1: convex, -1: concave
  bool sharp = true;      // an edge of the body; otherwise the smooth surface continues across it
  bool doubtful = false;  // either class is possible
  int straight = -1;      // 0 or 1: this side is a plane (or straight strip) next to a curved part, and keeps its normal here
};

struct Bends {
  std::vector<Bend> edges;                            // ascending by their ends
  std::vector<std::array<std::int32_t, 3>> edges_of;  // (T) of the sides 01, 12, 20
  std::vector<Vec3> normals;                          // (T) unit
  std::vector<std::int32_t> pane;                     // (T) first triangle of its plane
  std::vector<std::vector<std::int32_t>> corners_at;  // (P) corners 3 t + c at each point
  bool doubtful = false;                              // any doubtful edge
};

/// Classifies every edge. Edges that turn by more than sharp_angle_deg are sharp. Flatter edges are smooth if they stand in a row of
/// similar ones: at least four planes of similar width that turn the same way by similar angles. The others bound planes (bevels, ridges,
/// folds). Single triangles without a side on a sharp edge count as facets of a smooth surface. Doubtful: rows that turn by 25 to 50
/// degrees per edge, and rows of two and three.
Bends find_bends(const TriangleSurface& surface, double sharp_angle_deg);

/// True if v is the tip of a cone: the faces around it slope away from the mean normal without turning further.
bool is_tip(const TriangleSurface& surface, const Bends& bends, std::int32_t v, const Vec3& normal);

}  // namespace carillon::mesher
