#include "precompute/mesher/wall_mesh.hpp"

#include <fmt/core.h>

#include "precompute/mesher/body_surface.hpp"
#include "precompute/mesher/extrude.hpp"
#include "precompute/mesher/two_sides.hpp"
#include "runtime/base/error.hpp"

namespace carillon::mesher {
namespace {

/// Meshes a wall by extrusion. False for an impossible wall; fault: the reason, completing a sentence.
bool extrude_wall(const ThinBody& body, const SurfaceOptions& options, SurfaceReport& report, Phases& phases, mesh::TetMesh& out,
                  std::string& fault) {
  const SurfaceReport before = report;
  try {
    out = mesh_thin_wall(body, options, report, phases);
    return true;
  } catch (const WallError& failure) {
    fault = failure.what();
    auto seconds = std::move(report.seconds);
    report = before;
    report.seconds = std::move(seconds);
    return false;
  }
}

}  // namespace

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
  mesh::TetMesh out;
  std::string fault;
  if (!extrude_wall({.skin = body, .wall_m = *options.wall_m, .side = side}, options, report, phases, out, fault)) refuse(fault);
  return out;
}

std::optional<mesh::TetMesh> make_thin(const Body& body, const SurfaceOptions& options, SurfaceReport& report, Phases& phases) {
  const bool must = options.method == Method::kExtrusion || (options.side != Side::kAutomatic && options.side != Side::kOutside);
  if (!must && (options.method != Method::kAutomatic || options.order == 1)) return std::nullopt;
  const auto give_up = [&](const std::string& fault) {
    if (must) throw InputError(fmt::format("{}: the wall cannot be extruded from this surface: it {}", options.surface.string(), fault));
    report.reason.clear();
    report.remarks.push_back(
        fmt::format("The wall is thin, but it {}: the volume was meshed instead of the skin, which takes more nodes.", fault));
    return std::nullopt;
  };
  mesh::TetMesh out;
  std::string fault;
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
    if (extrude_wall(thin, options, report, phases, out, fault)) return out;
    return give_up(fault);
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
  if (extrude_wall(thin, options, report, phases, out, fault)) return out;
  return give_up(fault);
}

}  // namespace carillon::mesher
