// Extrusion of a skin to tetrahedra: one layer of prisms (or more); the count depends on the surface, not on the wall. Std only.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "precompute/mesh/tet_mesh.hpp"
#include "precompute/mesher/skin.hpp"
#include "precompute/mesher/wall_error.hpp"

namespace carillon::mesher {

struct Wall {
  std::vector<std::array<double, 2>> levels_m;  // (P) both sides along the offset direction: {-t, 0} if the skin is the outside
  std::vector<Vec3> low_m = {};                 // (P) instead of levels and offsets: points of the other side; the skin is then the outside
  int order = 2;
  int layers = 1;
  bool straight = false;  // mid-side nodes at the edge midpoints
  /// Point of the true surface for an edge midpoint (true: of a fold or border); if empty, an arc between the normals.
  std::function<Vec3(const Vec3& middle, bool is_fold)> middle = {};
  /// The same for a known low side.
  std::function<Vec3(const Vec3& middle)> low_middle = {};
};

struct Extruded {
  mesh::TetMesh mesh;  // node sets outer, inner and, for an open skin, rim. Column corners come first: level l at point v is l P + v
  double thickness_min_m = 0, thickness_mean_m = 0, thickness_max_m = 0;  // across the wall, at the skin's points
  double expected_volume_m3 = 0;                                          // flat prisms between the sides
  std::int64_t straightened = 0;                                          // elements made straight-sided to avoid folding
  std::vector<Edge> edges;  // skin edges, and their mid nodes on the high and low side (order 2)
  std::vector<std::array<std::int32_t, 2>> mid_nodes;
};

/// Offset direction of every skin point per metre of wall: at folds the shortest one with unit component along each side's normal (a
/// mitre). Throws WallError for folds of less than 29 degrees between the sides.
std::vector<Vec3> find_ways_out(const Skin& skin);

/// Every triangle becomes `layers` prisms, every prism three tetrahedra; side diagonals run from the low corner at the earlier point to the
/// high corner at the later one, in one point order: adjacent prisms conform. Order 2: mid-side nodes on both sides of the wall. Throws
/// WallError with the position where the wall is too thick for the curvature.
Extruded extrude(const Skin& skin, const Wall& wall);

}  // namespace carillon::mesher
