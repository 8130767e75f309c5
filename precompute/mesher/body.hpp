// Body between the skins, with the queries of the meshers.
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
// Edges longer than the body is thick do not coarsen the mesh: on plates and cubes the count levels out at the model's value for this
// multiple of the mean thickness.
constexpr double kEdgePerThickness = 1.4;

struct Body {
  RepairedSurface repaired;
  bool is_scan = false;                // sharp edges are noise
  std::optional<RoundSurface> round;   // smooth surface approximated by repaired.surface
  std::optional<DistanceField> field;  // for shells, repaired surfaces and stuffing
  std::optional<NearestPoint> nearest;
  std::vector<Polyline> curves;  // sharp curves of both skins in the last mesh
  double wall_m = 0;
  double thickness_m = 0;  // of the wall; of a solid: volume over half its area
  CountModel model{};
};

/// Refuses edges longer than the body, and edges that would give more than `most` nodes (InputError).
void check_edge(const SurfaceOptions& options, double edge_m, double diagonal_m, double nodes, double most);

/// Samples the distance for elements of edge_m. Throws InputError if the wall leaves no hollow or the surface encloses nothing.
DistanceField make_field(const Body& body, const SurfaceOptions& options, double edge_m);

/// Body for Delaunay refinement; with `keep_sharp` includes the sharp curves and stores them in body.curves and the report.
std::unique_ptr<DelaunayBody> make_delaunay(Body& body, const SurfaceOptions& options, double edge_m, bool keep_sharp,
                                            SurfaceReport& report);

DelaunaySizes calc_sizes(const Body& body, const SurfaceOptions& options, double edge_m);

/// Point of the nearest skin, or the best approximation found.
Vec3 project(const Body& body, Vec3 p);

/// Distance of p outside the body (or in its hollow), 0 inside: exact, by nearest surface point.
double calc_outside(const Body& body, const Vec3& p);
/// Distance of p from the nearest skin, on either side.
double calc_off_skin(const Body& body, const Vec3& p);

/// Point of the skin on the line through `middle` along the unit vector `normal` (for a clean solid the nearest point); empty beyond
/// reach_m.
std::optional<Vec3> find_skin(const Body& body, const Vec3& middle, const Vec3& normal, double reach_m);

}  // namespace carillon::mesher
