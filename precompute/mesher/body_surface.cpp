#include "precompute/mesher/body_surface.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "precompute/mesher/repair.hpp"

namespace carillon::mesher {
namespace {

constexpr double kMinBulgePerEdge = 0.02;  // of a linear element's edge: smaller bulges are below its chord error
// Relative to the diagonal and to the mean thickness: facets that bulge less count as round.
constexpr double kRoundness = 1e-4, kThinRoundness = 2e-4;
constexpr std::size_t kMaxRounded = 100'000;  // triangles
constexpr double kSmoothedPerEdge = 0.1;      // largest displacement of a smoothed point, relative to the edge

/// Scales the surface to the requested height. Returns the factor.
double fit_height(RepairedSurface& repaired, const SurfaceOptions& options, SurfaceReport& report) {
  Vec3 extent = calc_used_box(repaired.surface).extent();
  for (double& e : extent) e -= 2 * repaired.offset_m;
  double factor = 1;
  if (options.height_m) {
    factor = *options.height_m / extent[static_cast<int>(options.up)];
    // Offset and rounding are small; other factors would change the body.
    if (!(factor > 0.5 && factor < 2)) factor = 1;
    for (Vec3& p : repaired.surface.points) p = factor * p;
    repaired.offset_m *= factor;
    report.scale *= factor;
  }
  report.extent_m = factor * extent;
  return factor;
}

}  // namespace

void set_model(Body& body, const SurfaceOptions& options, double volume_m3, double area_m2) {
  body.wall_m = options.wall_m.value_or(0);
  // The wall is at most the whole volume; area of each skin: about volume over thickness.
  const double wall_volume = std::min(body.wall_m * area_m2, volume_m3);
  body.model = body.wall_m > 0 ? CountModel{.volume_m3 = wall_volume, .area_m2 = 2 * wall_volume / body.wall_m, .is_wall = true}
                               : CountModel{.volume_m3 = volume_m3, .area_m2 = area_m2};
  body.thickness_m = body.wall_m > 0 ? body.wall_m : 2 * volume_m3 / area_m2;
  // A second-order mesh of a solid has about 7.5 times as many nodes as corners, a thin wall fewer.
  if (options.order == 2) body.model.factor = body.wall_m > 0 ? 6.4 : 7.5;
}

double find_first_edge(const Body& body, const SurfaceOptions& options) {
  if (options.edge_m) return *options.edge_m;
  return body.model.find_edge(options.nodes ? static_cast<double>(*options.nodes) : (options.order == 2 ? 30000 : 10000));
}

double calc_min_nodes(const Body& body) { return body.model.calc_nodes(kEdgePerThickness * body.thickness_m); }

void smooth(Body& body, const SurfaceOptions& options, SurfaceReport& report) {
  body.is_scan = !report.wrapped && is_scan(body.repaired.surface, options.sharp_angle_deg);
  if (!body.is_scan) return;
  if (options.facets) {
    report.notes.push_back("The surface is as rough as a scan: none of its edges was kept sharp.");
    return;
  }
  set_model(body, options, std::abs(calc_volume(body.repaired.surface)), calc_area(body.repaired.surface));
  report.smoothed_m = smooth_scan(body.repaired.surface, kSmoothedPerEdge * find_first_edge(body, options));
  body.repaired.clean = body.repaired.clean && is_clean(body.repaired.surface);
  report.notes.push_back(
      fmt::format("The surface is as rough as a scan: its noise was smoothed, by up to {:.3g} m, and none of its edges was kept sharp; "
                  "--facets takes it as it is.",
                  report.smoothed_m));
}

void round(Body& body, const SurfaceOptions& options, SurfaceReport& report) {
  RepairedSurface& repaired = body.repaired;
  if (4 * repaired.surface.triangles.size() > kMaxRounded) return;
  RoundSurface round(repaired.surface, options.sharp_angle_deg);
  const double diagonal = calc_box(repaired.surface.points).diagonal();
  const double thickness = 2 * std::abs(calc_volume(repaired.surface)) / calc_area(repaired.surface);
  if (!round.is_doubtful() && round.get_largest_bulge() < std::min(kRoundness * diagonal, kThinRoundness * thickness)) return;
  // Fine cuts shorten the offsets to the smooth surface; irrelevant for linear elements.
  const double nodes = static_cast<double>(options.nodes.value_or(10000));
  const double shortest = options.edge_m.value_or(std::sqrt(calc_area(repaired.surface) / nodes));
  const double tolerance = options.order == 1 ? std::max(kRoundness * diagonal, kMinBulgePerEdge * shortest) : kRoundness * diagonal;
  int pieces = std::max(1, static_cast<int>(std::ceil(std::sqrt(round.get_usual_bulge() / tolerance))));
  while (pieces > 1 && repaired.surface.triangles.size() * pieces * pieces > kMaxRounded) --pieces;
  TriangleSurface rounded = round.cut(pieces);
  report.facet_pieces = pieces;
  if (repaired.clean && pieces > 1 && !is_clean(rounded)) {
    report.facet_pieces = 1;
    report.remarks.push_back("The smooth surface through the facets' corners would run through itself; the facets were taken as they are.");
    round.keep_facets();
    body.round = std::move(round);
    return;
  }
  repaired.surface = std::move(rounded);
  body.round = std::move(round);
}

/// The patches keep their own facets: scale those and round again.
void round_to_height(Body& body, const SurfaceOptions& options, SurfaceReport& report) {
  const bool is_rounded = !options.facets && !report.wrapped && !body.is_scan;
  RepairedSurface facets;
  if (is_rounded && options.height_m) facets = body.repaired;
  if (is_rounded) round(body, options, report);
  const double factor = fit_height(body.repaired, options, report);
  if (!body.round || factor == 1) return;
  for (Vec3& p : facets.surface.points) p = factor * p;
  facets.offset_m *= factor;
  body.repaired = std::move(facets);
  body.round.reset();
  round(body, options, report);
}

}  // namespace carillon::mesher
