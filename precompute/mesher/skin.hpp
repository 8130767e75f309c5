// Triangle surface with known sharp edges, remeshed to even triangles of a target size. Std only.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <unordered_set>
#include <vector>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Interpolated point of a mitre, on an edge from `fold` to `end`.
struct MitrePoint {
  std::int32_t point = 0, fold = 0, end = 0;
  double part = 0;  // of the edge, from the fold
  template <class T>
  void interpolate(std::vector<T>& values) const {
    values[point] = (1 - part) * values[fold] + part * values[end];
  }
};

/// Triangle surface, open or closed, at most two triangles per edge. Folds: sharp edges other than the border.
struct Skin {
  TriangleSurface surface;
  std::vector<Edge> folds;
  std::vector<MitrePoint> mitre_points = {};  // ends before the points between them and the fold
};

/// Target edge length.
struct SkinSizes {
  double largest_m = 0;
  double smallest_m = 0;     // at the tightest bends
  double per_radius = 0.35;  // of the smaller radius of curvature of the remeshed surface
  double reach_m = 0;        // wall thickness on the surface: edges at folds span its mitre plus margin_m
  double margin_m = 0;
};

/// Projections onto the surface.
struct SkinPlaces {
  std::function<Vec3(const Vec3&)> on_surface;  // nearest surface point
  std::function<Vec3(const Vec3&)> on_fold;     // nearest point of folds and borders
};

/// Unit normal at each triangle corner (T, 3): common to all corners at a point not separated by a fold, with weights exact on spheres; at
/// folds and borders rotated about them so that inward edges are arcs.
std::vector<std::array<Vec3, 3>> find_skin_normals(const Skin& skin);

/// Remeshes the surface to triangles near those sizes. Folds and borders stay; points where they bend by more than 40 degrees, end or meet
/// keep their position. Deterministic.
Skin remesh(const Skin& skin, const SkinSizes& sizes, const SkinPlaces& places);

/// Inserts a ring of narrow triangles along folds and borders: edges that leave them are split at `distance_m` from the fold. No split for
/// a distance of 0 or nearly the edge length.
struct LeavingEdge {
  std::int32_t point = 0;  // on the fold
  Vec3 way{}, across{};    // unit: along the edge, and normal to the fold
  double sine = 1;         // of the angle between edge and fold, at least kMinSine
};
inline constexpr double kMinSine = 0.3;
using RingDistance = std::function<double(const LeavingEdge& edge)>;
Skin add_rings(const Skin& skin, const SkinPlaces& places, const RingDistance& distance_m);

/// Divides the mitres at marked points of folds into elements of about `edge_m`.
Skin divide_mitres(const Skin& skin, const SkinPlaces& places, double edge_m, const std::vector<char>& is_mitred);

/// Moves points and flips edges in corners between the mitres of several folds, so that no copy of a triangle, with points `levels_m` along
/// `ways`, is folded or much smaller than the other. Points on folds stay on them.
Skin make_room(const Skin& skin, const SkinPlaces& places, const std::vector<Vec3>& ways, const std::array<double, 2>& levels_m);

/// Edges of one triangle, ascending.
std::vector<Edge> find_border(const TriangleSurface& surface);

using EdgeSet = std::unordered_set<Edge, EdgeHash>;
/// Folds and borders.
EdgeSet find_features(const Skin& skin);

}  // namespace carillon::mesher
