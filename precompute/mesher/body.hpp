// The body between the skins, with all that the meshers ask of it.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "precompute/mesher/count_search.hpp"
#include "precompute/mesher/delaunay.hpp"
#include "precompute/mesher/distance_field.hpp"
#include "precompute/mesher/nearest.hpp"
#include "precompute/mesher/round_surface.hpp"
#include "precompute/mesher/surface.hpp"
#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

constexpr double kMaxNodes = 2e7;
// Edges longer than the body is thick do not make the mesh coarser: on plates and cubes its count levels out at what the model gives for
// this multiple of the mean thickness.
constexpr double kEdgePerThickness = 1.4;

struct Body {
  RepairedSurface repaired;
  bool is_scan = false;                // its sharp edges are noise
  std::optional<RoundSurface> round;   // the smooth surface of which repaired.surface is a cut
  std::optional<DistanceField> field;  // of a shell, a repaired surface, or for stuffing
  std::optional<NearestPoint> nearest;
  std::vector<Polyline> curves;  // the sharp ones of both skins that the last mesh keeps
  double wall_m = 0;
  double thickness_m = 0;  // of the wall, or of the solid: volume over half its area
  CountModel model{};
};

/// Refuses edges longer than the body, and those that would give more than `most` nodes (InputError).
void check_edge(const SurfaceOptions& options, double edge_m, double diagonal_m, double nodes, double most);

/// Samples the distance for elements of edge_m. Throws InputError if the wall leaves no hollow or the surface encloses nothing.
DistanceField make_field(const Body& body, const SurfaceOptions& options, double edge_m);

/// The body for Delaunay refinement; with `keep_sharp` it has the sharp curves, which body.curves and the report learn.
std::unique_ptr<DelaunayBody> make_delaunay(Body& body, const SurfaceOptions& options, double edge_m, bool keep_sharp,
                                            SurfaceReport& report);

DelaunaySizes calc_sizes(const Body& body, const SurfaceOptions& options, double edge_m);

/// The point of the body's nearest skin, or the best that could be found on the way to it.
Vec3 project(const Body& body, Vec3 p);

/// How far p lies outside the body (or in its hollow), 0 within it: exact, by the nearest point of the surface.
double calc_outside(const Body& body, const Vec3& p);
/// How far p lies from the nearest skin, outside or inside.
double calc_off_skin(const Body& body, const Vec3& p);

/// The point of the skin on the line through `middle` along the unit vector `normal`, or of a clean solid the nearest one; nothing if it is
/// farther than reach_m.
std::optional<Vec3> find_skin(const Body& body, const Vec3& middle, const Vec3& normal, double reach_m);

}  // namespace carillon::mesher
