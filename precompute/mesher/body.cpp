// The body and the steps that use its distance field.
#include "precompute/mesher/body.hpp"

#include <fmt/core.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "precompute/mesher/nearest.hpp"
#include "precompute/mesher/triangle_surface.hpp"
#include "precompute/mesher/untangle_curves.hpp"
#include "runtime/base/crossing.hpp"
#include "runtime/base/error.hpp"

namespace carillon::mesher {
namespace {

using Normals = std::vector<Vec3>;

// Method: at a point of a sharp edge with adjacent unit normals n_i, the offset planes meet at the point displaced by x, the minimum-norm
//   least-squares solution of n_i . x = -wall; kept if it is `wall` from the surface.
// Source: Pavic and Kobbelt, "High-resolution volumetric computation of offset surfaces with feature preservation", CGF 27(2), 2008,
//   section 4 (the same point as minimum of a quadric); here only along known sharp edges.

// Faces with a smaller normal difference are one side of the edge (cosine of 25 degrees).
constexpr double kMinSideCosine = 0.906;
// Relative tolerance of the wall distance for points of the inner skin.
constexpr double kTolerance = 0.02;

Vec3 calc_area_normal(const TriangleSurface& surface, const Triangle& t) {
  return cross(surface.points[t[1]] - surface.points[t[0]], surface.points[t[2]] - surface.points[t[0]]);
}

/// One unit normal per side.
Normals group_sides(const Normals& area_normals) {
  Normals sums;
  for (const Vec3& n : area_normals) {
    if (!(norm(n) > 0)) continue;
    const auto same = std::find_if(sums.begin(), sums.end(), [&](const Vec3& s) { return dot(s, n) > kMinSideCosine * norm(s) * norm(n); });
    if (same == sums.end())
      sums.push_back(n);
    else
      *same = *same + n;
  }
  for (Vec3& s : sums) s = (1 / norm(s)) * s;
  return sums;
}

Vec3 calc_inset(const Normals& sides, double wall_m) {
  if (sides.empty()) return {};
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();  // normal equations
  Eigen::Vector3d right = Eigen::Vector3d::Zero(), x = right;
  for (const Vec3& side : sides) {
    const Eigen::Vector3d n(side[0], side[1], side[2]);
    normal += n * n.transpose();
    right -= wall_m * n;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(normal);
  for (int i = 0; i < 3; ++i) {
    const double square = solver.eigenvalues()[i];
    const auto direction = solver.eigenvectors().col(i);
    // Tolerance for the facets of a rounded side.
    if (square >= 0.01 * solver.eigenvalues()[2]) x += direction * (direction.dot(right) / square);
  }
  return {x[0], x[1], x[2]};
}

/// Sharp edges of a shell's inner skin: intersections of the planes next to the sharp `curves` after moving inward by `wall_m`. Pieces at
/// another distance from the surface (concave edges, where the offset is round; pieces cut off by another side's wall) are omitted. Points
/// are about `spacing_m` apart.
std::vector<Polyline> make_inset_curves(const TriangleSurface& surface, const std::vector<Polyline>& curves, const NearestPoint& nearest,
                                        double wall_m, double spacing_m) {
  std::map<Vec3, Normals> at_point;
  std::map<std::array<Vec3, 2>, Normals> at_edge;
  for (const Polyline& curve : curves)
    for (std::size_t i = 0; i < curve.size(); ++i) {
      at_point[curve[i]];
      if (i > 0) at_edge[curve[i - 1] < curve[i] ? std::array{curve[i - 1], curve[i]} : std::array{curve[i], curve[i - 1]}];
    }
  for (const Triangle& t : surface.triangles)
    for (int c = 0; c < 3; ++c) {
      const Vec3 &a = surface.points[t[c]], &b = surface.points[t[(c + 1) % 3]];
      const Vec3 normal = calc_area_normal(surface, t);
      if (const auto found = at_point.find(a); found != at_point.end()) found->second.push_back(normal);
      if (const auto found = at_edge.find(a < b ? std::array{a, b} : std::array{b, a}); found != at_edge.end())
        found->second.push_back(normal);
    }

  const auto is_on_skin = [&](const Vec3& p) { return std::abs(norm(nearest.find(p) - p) - wall_m) < kTolerance * wall_m; };
  std::vector<Polyline> out;
  for (const Polyline& curve : curves) {
    Polyline piece;
    const auto finish = [&] {
      if (piece.size() > 1) out.push_back(piece);
      piece.clear();
    };
    // A corner is the same point in all its curves; it replaces points too close before it.
    const auto add = [&](const Vec3& p, const Normals& normals, bool corner) {
      const Vec3 q = p + calc_inset(group_sides(normals), wall_m);
      if (!is_on_skin(q)) return;
      if (!piece.empty() && norm(q - piece.back()) > 3 * spacing_m) finish();
      if (corner)
        while (piece.size() > 1 && norm(q - piece.back()) < 0.4 * spacing_m) piece.pop_back();
      if (piece.empty() || norm(q - piece.back()) > 0.4 * spacing_m) piece.push_back(q);
    };
    add(curve.front(), at_point.at(curve.front()), true);
    for (std::size_t i = 0; i + 1 < curve.size(); ++i) {
      const Vec3 &a = curve[i], &b = curve[i + 1];
      const Normals& sides = at_edge.at(a < b ? std::array{a, b} : std::array{b, a});
      const int pieces = static_cast<int>(std::ceil(norm(b - a) / spacing_m));
      for (int k = 1; k < pieces; ++k) add(a + (static_cast<double>(k) / pieces) * (b - a), sides, false);
      add(b, at_point.at(b), i + 2 == curve.size());
    }
    // A closed curve with a complete inset is closed as well.
    if (curve.front() == curve.back() && piece.size() > 2 && norm(piece.front() - piece.back()) < 3 * spacing_m)
      piece.back() = piece.front();
    finish();
  }
  // Merge ends that nearly meet: the mesher would put ever smaller balls between them.
  std::vector<Vec3*> ends;
  for (Polyline& piece : out)
    for (Vec3* end : {&piece.front(), &piece.back()}) {
      const auto close = std::find_if(ends.begin(), ends.end(), [&](const Vec3* other) { return norm(*other - *end) < 0.5 * spacing_m; });
      if (close != ends.end()) *end = **close;
      ends.push_back(end);
    }
  std::erase_if(out, [](const Polyline& piece) { return piece.size() == 2 && piece.front() == piece.back(); });
  return out;
}

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
