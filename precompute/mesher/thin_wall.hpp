// Walls that are thin against the elements: from a surface to an extruded mesh.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "precompute/mesher/body.hpp"
#include "precompute/mesher/surface.hpp"

namespace carillon::mesher {

/// An open surface, which encloses no volume and needs a thickness.
struct Sheet {
  TriangleSurface surface;
  std::int64_t holes = 0;
  std::string fault = {};  // why it takes no wall: more than two triangles at an edge, or one side only; the end of a sentence
  SurfaceReport report = {};
};

/// The sheet that a heap of triangles is: its points joined, its triangles turned alike, and out where it is a vessel; nothing if it is
/// closed, or has no hole larger than what repair_surface closes.
std::optional<Sheet> find_sheet(const TriangleSurface& surface, const SurfaceOptions& options);

/// A closed surface that is the skin of a thin wall: its two sides without the rim between them.
struct TwoSides {
  TriangleSurface outer, inner;  // both as the closed surface has them: they face away from each other
  double thickness_m = 0;        // median
};

/// Nothing if more than a little of the surface has no other side within a fifth of the diagonal, or the sides do not face each other.
std::optional<TwoSides> find_two_sides(const TriangleSurface& closed);

/// Runs one phase and keeps its time.
using RunPhase = std::function<void(const std::string& name, const std::function<void()>& work)>;

/// What a thin wall is made of.
struct ThinBody {
  const Body& skin;               // repaired.surface, and round if it is smooth
  const Body* low = nullptr;      // the other side, where that is given and not a thickness
  double wall_m = 0;              // median
  double expected_volume_m3 = 0;  // 0: that of the skin with the wall
  Side side = Side::kOutside;
};

/// The length of edges on a wall that needs no answer from the user: a twelfth of the bending wave at 10 kHz in steel, glass or aluminium,
/// and at most eight times the wall.
double find_edge_rule(double wall_m);

/// What the mesh of a wall on a skin of this area will be, as the JSON object of an estimate (surface.hpp, Progress).
std::string format_thin_estimate(double area_m2, double wall_m, const SurfaceOptions& options);

/// How long the edges of the skin will be: as asked, to meet the count, or by the rule. The curvature shortens them further.
double find_thin_edge(const ThinBody& body, const SurfaceOptions& options);

/// Makes the mesh. Throws WallError (extrude.hpp) where the wall cannot be extruded from this surface, with the place; CountRefusal if the
/// count cannot be met.
mesh::TetMesh mesh_thin_wall(const ThinBody& body, const SurfaceOptions& options, SurfaceReport& report, const RunPhase& run,
                             const std::function<void(const std::string&)>& show);

}  // namespace carillon::mesher
