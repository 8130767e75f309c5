// A skin and a thickness to tetrahedra: one layer of prisms (or more), whose number depends on the surface and not on the wall. Std only.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <stdexcept>
#include <vector>

#include "precompute/mesh/tet_mesh.hpp"
#include "precompute/mesher/skin.hpp"

namespace carillon::mesher {

/// The skin cannot be extruded to this wall; what() is the predicate of a sentence about the wall and gives the place.
struct WallError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct Wall {
  std::vector<std::array<double, 2>> levels_m;  // (P) the two sides along the offset direction: {-t, 0} if the skin is the outside
  std::vector<Vec3> low_m = {};  // (P) in place of levels and ways: the points of the other side; the skin is the outside then
  int order = 2;
  int layers = 1;
  bool straight = false;  // mid-side nodes in the middle of their edges
  /// The point of the true surface for the middle of an edge (of a fold or border: true); without it, an arc between the normals.
  std::function<Vec3(const Vec3& middle, bool is_fold)> middle = {};
  /// The same for the low side, of a body whose low side is known too.
  std::function<Vec3(const Vec3& middle)> low_middle = {};
};

struct Extruded {
  mesh::TetMesh mesh;  // node sets outer, inner and, of an open skin, rim. The columns' corners come first: of level l at point v, l P + v
  double thickness_min_m = 0, thickness_mean_m = 0, thickness_max_m = 0;  // across the wall, at the skin's points
  double expected_volume_m3 = 0;                                          // by flat prisms between the sides
  std::int64_t straightened = 0;  // elements that would have folded over and were made straight-sided
  std::vector<Edge> edges;        // of the skin, and the mid node of each on the high and on the low side (order 2)
  std::vector<std::array<std::int32_t, 2>> mid_nodes;
};

/// For every point of the skin the offset direction per metre of wall: at folds the shortest one whose part along each side's normal is one
/// (a mitre). Throws WallError for folds of less than 29 degrees between the sides.
std::vector<Vec3> find_ways_out(const Skin& skin);

/// Every triangle becomes `layers` prisms, every prism three tetrahedra, cut so that the diagonal of each side runs from the low corner at
/// the earlier point to the high corner at the later one, in an order of all points: both prisms of a side agree. Order 2: mid-side nodes
/// on both sides of the wall. Throws WallError with the place where the wall is too thick for the surface's bend.
Extruded extrude(const Skin& skin, const Wall& wall);

}  // namespace carillon::mesher
