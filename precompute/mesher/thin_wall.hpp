// Walls thin relative to the elements: from a surface to an extruded mesh.
#pragma once

#include <optional>
#include <string>

#include "precompute/mesher/body.hpp"
#include "precompute/mesher/phases.hpp"

namespace carillon::mesher {

/// Open surface; a body only with a thickness.
struct Sheet {
  TriangleSurface surface;
  std::int64_t holes = 0;
  std::string fault = {};  // more than two triangles at an edge, or one-sided; completes a sentence
  SurfaceReport report = {};
};

/// Sheet from unordered triangles: merged points, consistent orientation, outward for a vessel. Empty for a closed surface, or without a
/// hole larger than repair_surface closes.
std::optional<Sheet> find_sheet(const TriangleSurface& surface, const SurfaceOptions& options);

/// Thin wall between its skin and a second side.
struct ThinBody {
  const Body& skin;               // repaired.surface, and round if smooth
  const Body* low = nullptr;      // other side of a measured wall
  double wall_m = 0;              // median
  double expected_volume_m3 = 0;  // 0: from skin and wall
  Side side = Side::kOutside;
};

/// Default edge length on a wall: a twelfth of the bending wave at 10 kHz in steel, glass or aluminium, at most eight times the thickness.
double find_edge_rule(double wall_m);

/// Skin edge length [m]: as requested, from the count, or by the rule. Curvature shortens it further.
double find_thin_edge(const ThinBody& body, const SurfaceOptions& options);

/// Makes the mesh. Throws WallError (wall_error.hpp) with the position of an impossible wall; CountRefusal if the count cannot be met.
mesh::TetMesh mesh_thin_wall(const ThinBody& body, const SurfaceOptions& options, SurfaceReport& report, Phases& phases);

}  // namespace carillon::mesher
