// Walls that are thin against the elements: from a surface to an extruded mesh.
#pragma once

#include <optional>
#include <string>

#include "precompute/mesher/body.hpp"
#include "precompute/mesher/phases.hpp"

namespace carillon::mesher {

/// An open surface, a body only with a thickness.
struct Sheet {
  TriangleSurface surface;
  std::int64_t holes = 0;
  std::string fault = {};  // more than two triangles at an edge, or one side only; the end of a sentence
  SurfaceReport report = {};
};

/// A sheet from unordered triangles: points joined, triangles turned alike, of a vessel outwards. Empty for a closed surface, or one
/// without a hole larger than repair_surface closes.
std::optional<Sheet> find_sheet(const TriangleSurface& surface, const SurfaceOptions& options);

/// A thin wall between its skin and a second side.
struct ThinBody {
  const Body& skin;               // repaired.surface, and round if it is smooth
  const Body* low = nullptr;      // the other side of a measured wall
  double wall_m = 0;              // median
  double expected_volume_m3 = 0;  // 0: that of the skin with the wall
  Side side = Side::kOutside;
};

/// Default length of edges on a wall: a twelfth of the bending wave at 10 kHz in steel, glass or aluminium, and at most eight times the
/// wall.
double find_edge_rule(double wall_m);

/// The expected mesh of a wall on a skin of this area, as the JSON object of an estimate (surface.hpp, Progress).
std::string format_thin_estimate(double area_m2, double wall_m, const SurfaceOptions& options);

/// Edges of the skin [m]: as asked, to meet the count, or by the rule. Curvature shortens them further.
double find_thin_edge(const ThinBody& body, const SurfaceOptions& options);

/// Makes the mesh. Throws WallError (extrude.hpp) with the place of an impossible wall; CountRefusal if the count cannot be met.
mesh::TetMesh mesh_thin_wall(const ThinBody& body, const SurfaceOptions& options, SurfaceReport& report, Phases& phases);

}  // namespace carillon::mesher
