// A skin: triangles whose sharp edges are known, remeshed to even triangles of a wanted size. Std only.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <unordered_set>
#include <vector>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// A triangle surface, open or closed, without an edge of three triangles. Folds: its sharp edges without the border.
struct Skin {
  TriangleSurface surface;
  std::vector<Edge> folds;
};

/// Wanted length of edges.
struct SkinSizes {
  double largest_m = 0;
  double smallest_m = 0;     // at the tightest bends
  double per_radius = 0.35;  // of the smaller radius of curvature of the remeshed surface
  double reach_m = 0;        // thickness of a wall on the surface: edges at folds span its mitre and margin_m more
  double margin_m = 0;
};

/// Projections that keep the points on the surface.
struct SkinPlaces {
  std::function<Vec3(const Vec3&)> on_surface;  // the point of the surface for one near it
  std::function<Vec3(const Vec3&)> on_fold;     // the same of its folds and borders
};

/// The unit normal of the skin at each corner of each triangle (T, 3): one for all corners at a point that no fold parts, by weights that
/// are exact on spheres; at a fold or border, where one side of the point is missing, turned about it so that the edges inward are arcs.
std::vector<std::array<Vec3, 3>> find_skin_normals(const Skin& skin);

/// The same surface in triangles near those sizes. Folds and borders stay; points where they bend by more than 40 degrees, end or meet stay
/// where they are. The same input gives the same triangles.
Skin remesh(const Skin& skin, const SkinSizes& sizes, const SkinPlaces& places);

/// A ring of narrow triangles along folds and borders: edges that leave them are cut at `distance_m` from the fold. A distance of 0, or of
/// nearly the whole edge, cuts nothing.
struct LeavingEdge {
  std::int32_t point = 0;  // on the fold
  Vec3 way{}, across{};    // unit: along the edge, and at right angles to the fold
  double sine = 1;         // of the angle between edge and fold, at least kMinSine
};
inline constexpr double kMinSine = 0.3;
using RingDistance = std::function<double(const LeavingEdge& edge)>;
Skin add_rings(const Skin& skin, const SkinPlaces& places, const RingDistance& distance_m);

/// Moves points and turns edges in corners between the mitres of several folds: no copy of a triangle, with its points `levels_m` along
/// their `ways`, is folded over or much smaller than the other. Points on folds stay on them.
Skin make_room(const Skin& skin, const SkinPlaces& places, const std::vector<Vec3>& ways, const std::array<double, 2>& levels_m);

/// The edges of one triangle, ascending.
std::vector<Edge> find_border(const TriangleSurface& surface);

using EdgeSet = std::unordered_set<Edge, EdgeHash>;
/// Folds and borders.
EdgeSet find_features(const Skin& skin);

}  // namespace carillon::mesher
