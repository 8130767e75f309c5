// From surface file to tetrahedra; the steps are in the other files of this folder.
#include "precompute/mesher/surface.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <exception>
#include <functional>
#include <map>
#include <new>
#include <optional>
#include <vector>

#include "precompute/mesh/check.hpp"
#include "precompute/mesh/curved.hpp"
#include "precompute/mesh/tet_mesh.hpp"
#include "precompute/mesher/body_surface.hpp"
#include "precompute/mesher/guard.hpp"
#include "precompute/mesher/phases.hpp"
#include "precompute/mesher/place_nodes.hpp"
#include "precompute/mesher/quiet.hpp"
#include "precompute/mesher/seams.hpp"
#include "precompute/mesher/tet_quality.hpp"
#include "precompute/mesher/thin_wall.hpp"
#include "precompute/mesher/triangle_surface.hpp"
#include "precompute/mesher/two_sides.hpp"
#include "precompute/mesher/volume_mesh.hpp"
#include "precompute/mesher/wall_error.hpp"
#include "runtime/base/failure.hpp"

namespace carillon::mesher {
namespace {

// Method: the mid node of a boundary edge moves along the mean normal of its two boundary faces to the skin; on a sharp curve it moves to
//   the nearest curve point. Folded elements become straight-sided again: few elements fold, so no reshaping or swapping is needed.
// Source: Dey, O'Bara and Shephard 2001, "Towards curvilinear meshing in 3D: the case of quadratic simplices", CAD 33, 199, section 3.

/// Finds the skin position for the midpoint `middle` of a boundary edge with outward unit normal `normal`, within reach_m; empty if none.
using SkinPlace = std::function<std::optional<Vec3>(const Vec3& middle, const Vec3& normal, double reach_m)>;

struct CurvedEdges {
  std::int64_t curved = 0;        // boundary edges whose mid node left the middle
  std::int64_t left = 0;          // boundary edges left straight: no skin near enough
  std::int64_t straightened = 0;  // folded elements made straight-sided again
};

// A mid node displaced by more than this part of its edge belongs to another part of the skin, or would fold the element.
constexpr double kReach = 0.3;
// Faces with a larger turn at an edge may lie on two sides of a sharp curve (cosine of 15 degrees).
constexpr double kTurn = 0.966;
// An end lies on a curve if nearer than this part of the edge.
constexpr double kMaxCurveDistancePerEdge = 1e-3;

struct BoundaryEdge {
  std::int32_t a = 0, b = 0;  // ends, a < b
  std::int32_t middle = 0;
  std::array<Vec3, 2> normals{};  // unit, of its two faces
};

/// Boundary edges, ordered by their ends.
std::vector<BoundaryEdge> find_boundary_edges(const mesh::TetMesh& mesh) {
  mesh::TetMesh linear;  // corners only, same numbering
  linear.nodes_m = mesh.nodes_m;
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e) linear.tets.insert(linear.tets.end(), mesh.tet(e).begin(), mesh.tet(e).begin() + 4);
  std::map<std::array<std::int32_t, 2>, BoundaryEdge> edges;
  for (const Triangle& t : find_boundary(linear)) {
    const Vec3 area = cross(mesh.nodes_m[t[1]] - mesh.nodes_m[t[0]], mesh.nodes_m[t[2]] - mesh.nodes_m[t[0]]);
    const Vec3 normal = (1 / norm(area)) * area;
    for (int c = 0; c < 3; ++c) {
      const auto [a, b] = std::minmax(t[c], t[(c + 1) % 3]);
      BoundaryEdge& edge = edges[{a, b}];
      edge.normals[norm(edge.normals[0]) > 0 ? 1 : 0] = normal;
    }
  }
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
    for (std::size_t m = 0; m < 6; ++m) {
      const auto tet = mesh.tet(e);
      const auto [a, b] = std::minmax(tet[mesh::kEdges[m][0]], tet[mesh::kEdges[m][1]]);
      const auto found = edges.find({a, b});
      if (found != edges.end()) found->second.a = a, found->second.b = b, found->second.middle = tet[4 + m];
    }
  std::vector<BoundaryEdge> out;
  for (const auto& [ends, edge] : edges) out.push_back(edge);
  return out;
}

/// Point of the curves nearest to p, and its distance.
std::pair<Vec3, double> find_on_curves(const std::vector<Polyline>& curves, const Vec3& p) {
  std::pair<Vec3, double> best{{}, HUGE_VAL};
  for (const Polyline& curve : curves)
    for (std::size_t i = 1; i < curve.size(); ++i) {
      const Vec3 &a = curve[i - 1], along = curve[i] - a;
      const double square = dot(along, along);
      const double t = square > 0 ? std::clamp(dot(p - a, along) / square, 0.0, 1.0) : 0;
      const Vec3 q = a + t * along;
      if (const double distance = norm(p - q); distance < best.second) best = {q, distance};
    }
  return best;
}

/// Moves the mid nodes of boundary edges of a straight-sided quadratic mesh onto the skin, those of sharp edges onto `curves`; elements
/// that fold become straight again. Inner mid nodes stay at the midpoints.
CurvedEdges curve_mesh(mesh::TetMesh& mesh, const std::vector<Polyline>& curves, const SkinPlace& find_place) {
  CurvedEdges out;
  for (const BoundaryEdge& edge : find_boundary_edges(mesh)) {
    const Vec3 &a = mesh.nodes_m[edge.a], &b = mesh.nodes_m[edge.b];
    const double length = norm(b - a), reach = kReach * length;
    const Vec3 middle = 0.5 * (a + b), sum = edge.normals[0] + edge.normals[1];
    std::optional<Vec3> place;
    if (!curves.empty() && dot(edge.normals[0], edge.normals[1]) < kTurn &&
        find_on_curves(curves, a).second < kMaxCurveDistancePerEdge * length &&
        find_on_curves(curves, b).second < kMaxCurveDistancePerEdge * length) {
      const auto [on_curve, distance] = find_on_curves(curves, middle);
      if (distance < reach) place = on_curve;
    }
    if (!place && norm(sum) > 0.2) place = find_place(middle, (1 / norm(sum)) * sum, reach);
    if (!place) {
      ++out.left;
    } else if (norm(*place - middle) > 1e-6 * length) {
      mesh.nodes_m[edge.middle] = *place;
      ++out.curved;
    }
  }
  out.straightened = mesh::straighten_folded_elements(mesh);
  return out;
}

/// Why a wall cannot be extruded: completes a sentence. `refusal`: the count of nodes is out of its reach.
struct WallFault {
  std::string text;
  std::exception_ptr refusal;
};

/// Meshes a wall by extrusion, or sets `fault`. Where the volume may be meshed instead (`is_optional`), a refused count is such a fault.
std::optional<mesh::TetMesh> extrude_wall(const ThinBody& body, const SurfaceOptions& options, bool is_optional, SurfaceReport& report,
                                          Phases& phases, WallFault& fault) {
  const SurfaceReport before = report;
  try {
    return mesh_thin_wall(body, options, report, phases);
  } catch (const WallError& failure) {
    fault = {failure.what(), nullptr};
  } catch (const CountRefusal&) {
    if (!is_optional) throw;
    fault = {fmt::format("has no mesh of its skin within 10 % of {} nodes", *options.nodes), std::current_exception()};
  }
  auto seconds = std::move(report.seconds);
  report = before;
  report.seconds = std::move(seconds);
  return std::nullopt;
}

/// Open sheet with a wall. Throws InputError if it cannot be extruded.
mesh::TetMesh make_sheet(Sheet sheet, const SurfaceOptions& options, SurfaceReport& report, Phases& phases) {
  const auto refuse = [&](const std::string& fault) {
    throw InputError(fmt::format("{}: it is an open sheet, and its wall {}; correct it in a modeller, or give a thinner wall",
                                 options.surface.string(), fault));
  };
  if (!sheet.fault.empty()) refuse(sheet.fault);
  if (options.method == Method::kDelaunay || options.method == Method::kStuffing)
    throw InputError(fmt::format("{}: it is an open sheet, which needs --method extrude or auto", options.surface.string()));
  Body body;
  body.repaired = {std::move(sheet.surface), 0, false};
  phases.run("rounding", [&] { round_to_height(body, options, report); });
  report.input_area_m2 = calc_area(body.repaired.surface);
  report.input_volume_m3 = *options.wall_m * report.input_area_m2;
  const Side side = options.side == Side::kAutomatic ? Side::kMiddle : options.side;
  report.reason =
      fmt::format("the surface is open ({} border{}): it is the {} of a wall of {:.3g} mm", sheet.holes, sheet.holes == 1 ? "" : "s",
                  side == Side::kMiddle    ? "middle"
                  : side == Side::kOutside ? "outside"
                                           : "inside",
                  1000 * *options.wall_m);
  WallFault fault;
  auto out = extrude_wall({.skin = body, .wall_m = *options.wall_m, .side = side}, options, false, report, phases, fault);
  if (!out) refuse(fault.text);
  return std::move(*out);
}

/// Extruded wall of a closed body, if requested or thinner than the element length. Empty for bodies left to the volume meshers, with the
/// reason in the report and in `fault`. Throws InputError if extrusion was requested and is impossible.
std::optional<mesh::TetMesh> make_thin(const Body& body, const SurfaceOptions& options, SurfaceReport& report, Phases& phases,
                                       WallFault& fault) {
  const bool must = options.method == Method::kExtrusion || (options.side != Side::kAutomatic && options.side != Side::kOutside);
  if (!must && (options.method != Method::kAutomatic || options.order == 1)) return std::nullopt;
  const auto give_up = [&](const std::string& why) {
    if (must) throw InputError(fmt::format("{}: the wall cannot be extruded from this surface: it {}", options.surface.string(), why));
    report.reason.clear();
    report.remarks.push_back(
        fmt::format("The wall is thin, but it {}: the volume was meshed instead of the skin, which takes more nodes.", why));
    return std::nullopt;
  };
  if (options.wall_m) {
    ThinBody thin{.skin = body, .wall_m = *options.wall_m, .side = options.side == Side::kAutomatic ? Side::kOutside : options.side};
    const double edge = find_thin_edge(thin, options);
    if (!must && edge <= *options.wall_m) {
      report.reason =
          fmt::format("elements of {:.3g} mm are not longer than the wall is thick ({:.3g} mm)", 1000 * edge, 1000 * *options.wall_m);
      return std::nullopt;
    }
    if (report.wrapped) return give_up("has a surface that could not be closed and was wrapped");
    report.reason =
        must ? "it was asked for"
             : fmt::format("the wall ({:.3g} mm) is thinner than the elements are long ({:.3g} mm)", 1000 * *options.wall_m, 1000 * edge);
    if (auto out = extrude_wall(thin, options, !must, report, phases, fault)) return out;
    return give_up(fault.text);
  }
  std::optional<TwoSides> sides;
  if (!report.wrapped && report.components <= 2)
    phases.run("looking for a wall", [&] { sides = find_two_sides(body.round ? body.round->get_facets() : body.repaired.surface); });
  if (!sides) {
    if (must)
      throw InputError(
          fmt::format("{}: it is a closed surface and not a thin wall; give --wall for the thickness of a wall", options.surface.string()));
    return std::nullopt;
  }
  Body outer, inner;
  outer.repaired = {std::move(sides->outer), 0, false};
  inner.repaired = {std::move(sides->inner), 0, false};
  if (!options.facets) {
    round(outer, options, report);
    round(inner, options, report);
  }
  ThinBody thin{.skin = outer, .low = &inner, .wall_m = sides->thickness_m, .expected_volume_m3 = report.input_volume_m3};
  const double edge = find_thin_edge(thin, options);
  if (!must && edge <= thin.wall_m) return std::nullopt;
  report.reason = fmt::format("the body is itself a wall, of {:.3g} mm, and thinner than the elements are long ({:.3g} mm)",
                              1000 * thin.wall_m, 1000 * edge);
  if (auto out = extrude_wall(thin, options, !must, report, phases, fault)) return out;
  return give_up(fault.text);
}

constexpr double kSmallest = 1e-10, kLargest = 1e9;  // body size, in metres
// Processor time limits [s] (guard_program), of the repair and of the rest. The hollow bunny of 37,000 nodes takes 7 s, its limit is 670 s.
constexpr double kMinCpuOfRepair = 10, kMinCpu = 12, kCpuPerTriangle = 2e-3, kCpuPerNode = 5e-3;

void check_options(const SurfaceOptions& o) {
  const auto positive = [&](const std::optional<double>& value, const char* name) {
    if (value && !(*value > 0 && std::isfinite(*value)))
      throw InputError(fmt::format("{} is {}; it must be a positive number of metres", name, *value));
  };
  positive(o.wall_m, "wall");
  positive(o.height_m, "height");
  positive(o.edge_m, "edge");
  if (o.scale && !(*o.scale > 0 && std::isfinite(*o.scale)))
    throw InputError(fmt::format("scale is {}; it must be a positive number", *o.scale));
  if (o.close_holes && !(*o.close_holes >= 0 && *o.close_holes <= 1))
    throw InputError(fmt::format("close_holes is {}; it must be a part of the body's diagonal, from 0 to 1", *o.close_holes));
  if (o.height_m && o.scale) throw InputError("height and scale exclude each other; give one of them");
  if (o.edge_m && o.nodes) throw InputError("edge and nodes exclude each other; give one of them");
  if (o.order < 0 || o.order > 2) throw InputError(fmt::format("order is {}; it must be 1 or 2, or 0 for the method's own", o.order));
  if (o.nodes && !(*o.nodes >= (o.order <= 1 ? 8 : 27) && static_cast<double>(*o.nodes) <= kMaxNodes))
    throw InputError(fmt::format("nodes is {}; it must be from {} to {:.0f}", *o.nodes, o.order <= 1 ? 8 : 27, kMaxNodes));
  if (!(o.sharp_angle_deg > 0 && o.sharp_angle_deg <= 180))
    throw InputError(fmt::format("the sharp angle is {} degrees; it must be in (0, 180]", o.sharp_angle_deg));
  if (!(o.sliver_deg >= 0 && o.sliver_deg <= 30))
    throw InputError(fmt::format("the angle of slivers is {} degrees; it must be in [0, 30]", o.sliver_deg));
}

/// Scales the surface to metres. A sheet may be flat, but not along the height axis.
void scale_surface(TriangleSurface& surface, const SurfaceOptions& options, SurfaceReport& report, bool is_sheet) {
  const Box box = calc_used_box(surface);
  const Vec3 extent = box.extent();
  const int up = static_cast<int>(options.up);
  for (int c = 0; c < 3; ++c)
    if (!(extent[c] > 1e-9 * box.diagonal()) && !(is_sheet && (c != up || !options.height_m)))
      throw InputError(fmt::format(
          "{}: the surface is flat: its extent along {} is {}; a closed surface that encloses a volume is needed, or --wall for the "
          "thickness of a sheet (of a job's body: \"wall_m\")",
          options.surface.string(), "xyz"[c], extent[c]));
  double farthest = 0;
  for (int c = 0; c < 3; ++c) farthest = std::max({farthest, std::abs(box.low[c]), std::abs(box.high[c])});
  if (std::max({extent[0], extent[1], extent[2]}) < 1e-10 * farthest)
    throw InputError(
        fmt::format("{}: the surface lies {:.3g} of its own lengths from the origin, so that its coordinates have lost their digits; "
                    "move it to the origin and export it again",
                    options.surface.string(), farthest / std::max({extent[0], extent[1], extent[2]})));
  report.scale = options.height_m ? *options.height_m / extent[up] : options.scale.value_or(1);
  const double size = report.scale * std::max({extent[0], extent[1], extent[2]});
  if (!(size >= kSmallest && size <= kLargest))
    throw InputError(fmt::format("{}: the body would be {:.3g} m long; it must be from {:.0e} to {:.0e} m; give its height or a scale",
                                 options.surface.string(), size, kSmallest, kLargest));
  for (Vec3& p : surface.points) p = report.scale * p;
  report.extent_m = report.scale * extent;
  const double largest = std::max({report.extent_m[0], report.extent_m[1], report.extent_m[2]});
  if (largest > 20 || largest < 1e-3)
    report.remarks.push_back(fmt::format(
        "The body is {:.3g} m long. If the file is not in metres, give its height or a scale (0.001 for millimetres).", largest));
}

/// Notes on seams and dropped points.
void note_input(SurfaceReport& report) {
  if (report.seam_edges > 0)
    report.notes.push_back(fmt::format(
        "The seams of its faces were closed: {} borders, whose sides lay up to {:.2g} m apart, were joined (as are all within "
        "{:.2g} m, {:g} of the body's diagonal).",
        report.seam_edges, report.seam_m, kSeam * norm(Vec3{report.extent_m[0], report.extent_m[1], report.extent_m[2]}), kSeam));
  if (report.unused_points > 0)
    report.notes.push_back(fmt::format("{} point{} of the file belong{} to no triangle and {} dropped.", report.unused_points,
                                       report.unused_points == 1 ? "" : "s", report.unused_points == 1 ? "s" : "",
                                       report.unused_points == 1 ? "was" : "were"));
}

/// Moves the mid nodes of the boundary onto the skins.
void curve(mesh::TetMesh& mesh, const Body& body, SurfaceReport& report) {
  const CurvedEdges edges = curve_mesh(
      mesh, body.curves, [&](const Vec3& middle, const Vec3& normal, double reach_m) { return find_skin(body, middle, normal, reach_m); });
  report.curved_edges = edges.curved;
  report.straight_edges = edges.left;
  report.straightened_tets = edges.straightened;
}

/// Moves skin nodes to the smooth surface and recomputes the volume.
void place_nodes(mesh::TetMesh& mesh, const Body& body, const SurfaceOptions& options, SurfaceReport& report) {
  report.straightened_tets += place_on_smooth_surface(mesh, body, options.straight);
  remark_doubt(mesh, report);
  report.volume_m3 = calc_mesh_volume(mesh);
}

void add_notes(const SurfaceOptions& options, const Body& body, SurfaceReport& report) {
  const double error = report.volume_m3 / report.expected_volume_m3 - 1;
  if (std::abs(error) > 0.03)
    report.notes.push_back(
        fmt::format("The mesh has {:+.1f} % of volume against the body: its elements are coarse for its shape; more nodes bring it closer.",
                    100 * error));
  if (report.min_dihedral_deg < 8)
    report.remarks.push_back(fmt::format("The flattest element has a dihedral angle of {:.1f} degrees.", report.min_dihedral_deg));
  if (options.height_m) {
    const int up = static_cast<int>(options.up);
    if (std::abs(report.mesh_extent_m[up] / *options.height_m - 1) > 0.02)
      report.notes.push_back(fmt::format("The mesh is {:.4g} m high where {:.4g} m were asked for: its elements are coarse for its shape.",
                                         report.mesh_extent_m[up], *options.height_m));
  }
  if (body.wall_m > 0 && options.order == 1 && report.layers_mean < 1.5)
    report.notes.push_back(
        fmt::format("The wall is about {:.1f} linear elements thick and will be too stiff in bending; take more nodes or order 2.",
                    report.layers_mean));
}

[[noreturn]] void refuse_open(const SurfaceOptions& options, const Sheet& sheet) {
  throw InputError(fmt::format(
      "{}: it is an open surface ({} border{}), which has no thickness: give one with --wall (of a job's body: \"wall_m\"), or, "
      "of a solid body, say up to which part of its diagonal holes are closed, with --close-holes (\"close_holes\")",
      options.surface.string(), sheet.holes, sheet.holes == 1 ? "" : "s"));
}

mesh::TetMesh make_mesh(const SurfaceOptions& given, SurfaceReport& report, Phases& phases) {
  SurfaceOptions options = given;
  Body body;
  SurfaceInput input = phases.run("reading", [&] { return read_input(options.surface); });
  TriangleSurface& raw = input.surface;
  report.input_triangles = input.triangles;
  const auto calc_limit = [&](double start, double nodes) {
    return start + kCpuPerTriangle * static_cast<double>(report.input_triangles) + kCpuPerNode * nodes;
  };
  const double asked = static_cast<double>(options.nodes.value_or(0));
  std::optional<CpuLimit> cpu_limit(std::in_place, calc_limit(kMinCpuOfRepair, asked));
  std::optional<Sheet> sheet;
  if (options.wall_m || options.refuses_open) phases.run("repairing", [&] { sheet = find_sheet(raw, options); });
  if (sheet && !options.wall_m) refuse_open(options, *sheet);
  scale_surface(raw, options, report, sheet.has_value());
  report.unused_points = input.unused_points;
  report.seam_edges = input.seams.edges;
  report.seam_m = report.scale * input.seams.widest;
  if (sheet) {
    for (Vec3& p : sheet->surface.points) p = report.scale * p;
    const auto take = [&] {
      report.removed_triangles = sheet->report.removed_triangles;
      report.flipped_triangles = sheet->report.flipped_triangles;
      report.input_vertices = sheet->report.input_vertices;
      report.components = sheet->report.components;
      return make_sheet(std::move(*sheet), options, report, phases);
    };
    if (options.method == Method::kExtrusion || (sheet->fault.empty() && sheet->report.components == 1)) return take();
    try {  // many parts may be the triangle soup of a closed body
      body.repaired = phases.run("repairing", [&] { return repair_surface(raw, options, report); });
    } catch (const InputError&) {
      return take();
    }
  } else {
    body.repaired = phases.run("repairing", [&] { return repair_surface(std::move(raw), options, report); });
  }
  phases.run("smoothing", [&] { smooth(body, options, report); });
  phases.run("rounding", [&] { round_to_height(body, options, report); });
  const TriangleSurface& surface = body.repaired.surface;
  report.input_area_m2 = calc_area(surface);
  report.input_volume_m3 = body.round ? body.round->calc_volume() : calc_volume(surface) - body.repaired.offset_m * report.input_area_m2;
  WallFault wall;
  if (std::optional<mesh::TetMesh> thin = make_thin(body, options, report, phases, wall)) return std::move(*thin);
  if (options.order == 0) options.order = 1;
  set_model(body, options, report.input_volume_m3, report.input_area_m2);
  const double edge = find_first_edge(body, options);
  check_edge(options, edge, calc_box(surface.points).diagonal(), body.model.calc_nodes(edge), 1.5 * kMaxNodes);
  const double min_nodes = calc_min_nodes(body);
  cpu_limit.emplace(calc_limit(kMinCpu, options.nodes ? asked : std::max(body.model.calc_nodes(edge), min_nodes)));
  mesh::TetMesh linear;
  try {
    check_count(options, min_nodes);
    if (!options.edge_m && !options.nodes)
      report.remarks.push_back("Neither nodes nor edge was given: about 10,000 corner nodes (order 2: 30,000 nodes in all) were aimed at.");
    phases.show(fmt::format("about {:.0f} nodes", std::max(body.model.calc_nodes(edge), min_nodes)));
    linear = make_volume_mesh(body, options, edge, report, phases);
  } catch (const CountRefusal&) {
    if (wall.refusal) std::rethrow_exception(wall.refusal);  // its skin takes fewer
    throw;
  }
  mesh::TetMesh out = options.order == 2 ? mesh::to_quadratic(linear) : std::move(linear);
  if (options.order == 2 && !options.straight) phases.run("curving", [&] { curve(out, body, report); });
  if (body.round || options.order == 2) phases.run("placing nodes", [&] { place_nodes(out, body, options, report); });
  report.nodes = static_cast<std::int64_t>(out.nodes_m.size());
  report.mesh_extent_m = calc_box(out.nodes_m).extent();
  add_notes(options, body, report);
  return out;
}

}  // namespace

mesh::TetMesh mesh_surface(const SurfaceOptions& options, SurfaceReport& report, const Progress& progress) {
  report = SurfaceReport{};
  check_options(options);
  Phases phases(report, progress, options.surface.string());
  const Quiet quiet;
  try {
    mesh::TetMesh mesh = make_mesh(options, report, phases);
    if (report.removed_triangles > 0)
      report.notes.push_back(fmt::format("{} of the {} triangles of the surface were dropped: they have no area, or are there twice.",
                                         report.removed_triangles, report.input_triangles));
    note_input(report);
    return mesh;
  } catch (const std::bad_alloc&) {
    throw SystemError(fmt::format("{}: memory ran out while meshing; ask for longer edges or fewer nodes", options.surface.string()));
  }
}

SurfaceLook look_at_surface(const std::filesystem::path& surface) {
  SurfaceInput input = read_input(surface);
  TriangleSurface& raw = input.surface;
  weld(raw, kSamePoint * calc_box(raw.points).diagonal());
  SurfaceLook look{.triangles = input.triangles, .unused_points = input.unused_points, .seam_edges = input.seams.edges};
  look.extent = calc_used_box(raw).extent();
  look.parts = count_bodies(raw);
  SurfaceOptions options;
  options.surface = surface;
  if (const std::optional<Sheet> sheet = find_sheet(raw, options)) {
    look.openings = sheet->holes;
    look.parts = sheet->report.components;
  } else if (const std::optional<TwoSides> sides = find_two_sides(raw)) {
    look.thickness = sides->thickness_m;
  }
  return look;
}

}  // namespace carillon::mesher
