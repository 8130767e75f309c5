// Which edges of a triangle surface are edges of the body, and which come only from cutting a smooth surface into facets.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// An edge of the triangles.
struct Bend {
  std::array<std::int32_t, 2> ends{};         // points, ascending
  std::array<std::int32_t, 2> faces{-1, -1};  // triangles
  int count = 0;                              // of triangles; 2 on a closed surface
  double turn_deg = 180;
  double sign = 1;        // 1: convex, -1: concave
  bool sharp = true;      // an edge of the body; otherwise the smooth surface continues across it
  bool doubtful = false;  // could as well be the other
  int straight = -1;      // 0 or 1: the face on this side is a plane (or a straight strip) next to a curved part, and keeps its normal here
};

struct Bends {
  std::vector<Bend> edges;                            // ascending by their ends
  std::vector<std::array<std::int32_t, 3>> edges_of;  // (T) of the sides 01, 12, 20
  std::vector<Vec3> normals;                          // (T) unit
  std::vector<std::int32_t> pane;                     // (T) the first triangle of the plane that it belongs to
  std::vector<std::vector<std::int32_t>> corners_at;  // (P) corners 3 t + c at each point
  bool doubtful = false;                              // one of the edges is
};

/// Judges every edge. Edges that turn by more than sharp_angle_deg are sharp. Of the flatter ones those are smooth that stand in a row with
/// others like them: at least four planes of similar width that turn the same way by similar angles. The rest bounds planes: bevels,
/// ridges, folds. Single triangles without a side on a sharp edge are taken for facets of a smooth surface whatever their neighbours.
/// Doubtful are edges in a row that turn by 25 to 50 degrees, and edges in rows of two and three.
Bends find_bends(const TriangleSurface& surface, double sharp_angle_deg);

/// True if v is the tip of a cone: the faces around it slope away from the mean normal and do not turn further on.
bool is_tip(const TriangleSurface& surface, const Bends& bends, std::int32_t v, const Vec3& normal);

}  // namespace carillon::mesher
