// The body and the steps that use its distance field.
#include "precompute/mesher/body.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "precompute/mesher/inset_curves.hpp"
#include "precompute/mesher/untangle_curves.hpp"
#include "runtime/base/crossing.hpp"
#include "runtime/base/error.hpp"

namespace carillon::mesher {
namespace {

// Curves closer than this part of an edge (except at common ends) would need hundreds of balls per element between them.
constexpr double kMinCurveGapPerEdge = 0.01;

[[noreturn]] void throw_solid(const SurfaceOptions& options, double deepest_m) {
  throw InputError(
      fmt::format("{}: a wall of {:.4g} m leaves no hollow: no point of the body is deeper than {:.4g} m under its surface; "
                  "give a thinner wall, or none for a solid",
                  options.surface.string(), *options.wall_m, deepest_m));
}

}  // namespace

void check_edge(const SurfaceOptions& options, double edge_m, double diagonal_m, double nodes, double most) {
  if (options.edge_m && edge_m > diagonal_m)
    throw InputError(fmt::format("{}: edges of {:.3g} m are longer than the body ({:.3g} m); ask for shorter ones",
                                 options.surface.string(), edge_m, diagonal_m));
  if (nodes > most)
    throw InputError(fmt::format("{}: edges of {:.3g} m would give about {:.3g} nodes, more than {:.0g}; ask for longer ones",
                                 options.surface.string(), edge_m, nodes, kMaxNodes));
}

DistanceField make_field(const Body& body, const SurfaceOptions& options, double edge_m) {
  const Vec3 extent = calc_box(body.repaired.surface.points).extent();
  const double diagonal = norm(extent);
  // Three samples per edge and eight through the wall, up to sixty million samples.
  constexpr double kPleasantSamples = 6e7;
  double voxel = std::min({edge_m / 3, diagonal / 80, body.wall_m > 0 ? body.wall_m / 8 : diagonal});
  voxel = std::max(voxel, std::cbrt(extent[0] * extent[1] * extent[2] / kPleasantSamples));
  if (body.wall_m > 0) voxel = std::min(voxel, body.wall_m / 4);
  const double half = 0.5 * std::min({extent[0], extent[1], extent[2]});
  if (body.wall_m >= half) throw_solid(options, half);
  DistanceField field = [&] {
    try {
      // Outside, stuffing samples one edge away; the wrap's offset extends the inside.
      return calc_distance_field(body.repaired.surface, voxel,
                                 {std::max(4 * voxel, std::min(edge_m, diagonal / 20)),
                                  std::max(body.wall_m + 4 * voxel, options.method == Method::kStuffing ? 2 * edge_m : 0.0)},
                                 body.repaired.offset_m);
    } catch (const InputError& failure) {
      throw InputError(fmt::format("{}: {}", options.surface.string(), failure.what()));
    }
  }();
  const auto deepest = *std::min_element(field.samples.begin(), field.samples.end());
  if (deepest >= 0)
    throw InputError(
        fmt::format("{}: the surface encloses nothing thicker than {:.3g} m, the resolution for edges of {:.3g} m; "
                    "ask for shorter edges or more nodes",
                    options.surface.string(), voxel, edge_m));
  if (body.wall_m > 0 && deepest >= -body.wall_m) throw_solid(options, -static_cast<double>(deepest));
  return field;
}

std::unique_ptr<DelaunayBody> make_delaunay(Body& body, const SurfaceOptions& options, double edge_m, bool keep_sharp,
                                            SurfaceReport& report) {
  std::vector<Polyline>& curves = body.curves;
  curves.clear();
  report.sharp_edges_m = 0;
  report.sharp_curves = 0;
  if (keep_sharp && !report.wrapped && !body.is_scan) {
    const double diagonal = calc_box(body.repaired.surface.points).diagonal();
    curves = find_sharp_curves(body.repaired.surface, options.sharp_angle_deg, std::min(3 * edge_m, 0.1 * diagonal), 2 * edge_m);
    report.sharp_curves = static_cast<std::int64_t>(curves.size());
    for (const Polyline& curve : curves)
      for (std::size_t i = 1; i < curve.size(); ++i) report.sharp_edges_m += norm(curve[i] - curve[i - 1]);
    if (body.wall_m > 0 && !curves.empty()) {
      const auto inset = make_inset_curves(body.repaired.surface, curves, *body.nearest, body.wall_m, 0.5 * edge_m);
      curves.insert(curves.end(), inset.begin(), inset.end());
    }
  }
  curves = untangle_curves(std::move(curves), kMinCurveGapPerEdge * edge_m);
  return body.field ? make_field_body(*body.field, body.wall_m, curves) : make_surface_body(body.repaired.surface, curves);
}

DelaunaySizes calc_sizes(const Body& body, const SurfaceOptions& options, double edge_m) {
  const double distance = body.wall_m > 0 ? std::min(0.1 * edge_m, 0.15 * body.wall_m) : 0.1 * edge_m;
  // Runaway limit, far above any reasonable count for this edge length. Without a target, a thin body takes the count its thickness needs.
  const double effective = options.nodes ? edge_m : std::min(edge_m, kEdgePerThickness * body.thickness_m);
  const double max_nodes = 3000 + 5 * std::max(body.model.calc_nodes(effective), static_cast<double>(options.nodes.value_or(0)));
  return {edge_m, distance, static_cast<std::size_t>(std::min(max_nodes, 3 * kMaxNodes))};
}

Vec3 project(const Body& body, Vec3 p) {
  if (!body.field) return body.nearest->find(p);
  const DistanceField& field = *body.field;
  const double level = field.calc_distance(p) < -0.5 * body.wall_m && body.wall_m > 0 ? -body.wall_m : 0;
  double off = field.calc_distance(p) - level;
  for (int n = 0; n < 6 && std::abs(off) > 1e-3 * field.voxel_m; ++n) {
    Vec3 gradient{};
    for (int c = 0; c < 3; ++c) {
      Vec3 low = p, high = p;
      low[c] -= 0.5 * field.voxel_m;
      high[c] += 0.5 * field.voxel_m;
      gradient[c] = (field.calc_distance(high) - field.calc_distance(low)) / field.voxel_m;
    }
    const double square = dot(gradient, gradient);
    if (square < 0.1) break;  // medial axis: no nearest skin
    // Near the medial axis the slope is too small and the step too long: halve until closer.
    Vec3 step = (off / square) * gradient;
    double closer = off;
    for (int half = 0; half < 5; ++half, step = 0.5 * step) {
      closer = field.calc_distance(p - step) - level;
      if (std::abs(closer) < std::abs(off)) break;
    }
    if (!(std::abs(closer) < std::abs(off))) break;
    p = p - step;
    off = closer;
  }
  return p;
}

namespace {

/// Distance to the true surface, negative inside; positive for a clean solid, where the sign is unknown.
double calc_signed(const Body& body, const Vec3& p) {
  const double way = norm(body.nearest->find(p) - p);
  const bool inside = body.field && body.field->calc_distance(p) < body.repaired.offset_m;
  return (inside ? -way : way) + body.repaired.offset_m;
}

}  // namespace

double calc_outside(const Body& body, const Vec3& p) {
  const double d = calc_signed(body, p);
  if (!body.field)
    return d > 1e-9 * calc_box(body.repaired.surface.points).diagonal() && std::abs(calc_winding(body.repaired.surface, p)) < 0.5 ? d : 0;
  return std::max({0.0, d, body.wall_m > 0 ? -d - body.wall_m : 0.0});
}

double calc_off_skin(const Body& body, const Vec3& p) {
  const double d = calc_signed(body, p);
  return body.wall_m > 0 ? std::min(std::abs(d), std::abs(d + body.wall_m)) : std::abs(d);
}

std::optional<Vec3> find_skin(const Body& body, const Vec3& middle, const Vec3& normal, double reach_m) {
  if (!body.field) {
    const Vec3 p = body.nearest->find(middle);
    return norm(p - middle) < reach_m ? std::optional(p) : std::nullopt;
  }
  // The body function approximates a distance: first guess.
  const auto calc = [&](double t) { return calc_body(*body.field, body.wall_m, middle + t * normal); };
  double low = 0, at_low = calc(0), high = 0, at_high = at_low;
  for (double way = 1.5 * std::abs(at_low) + 0.01 * reach_m; (at_high > 0) == (at_low > 0); way *= 2) {
    low = high, at_low = at_high;
    high = at_low > 0 ? -std::min(way, reach_m) : std::min(way, reach_m);
    if (high == low) return std::nullopt;
    at_high = calc(high);
  }
  return middle + base::find_crossing(calc, low, at_low, high, at_high, 0, 1e-6 * reach_m, 40) * normal;
}

}  // namespace carillon::mesher
