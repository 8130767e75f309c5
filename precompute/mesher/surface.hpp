// Closed surfaces to tetrahedra: the solid, or the shell between a surface and its inward offset.
//
// The only public header of the library; std only. CGAL (GPL-3) is confined to this library and carillon-mesh.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "precompute/mesh/tet_mesh.hpp"
#include "runtime/base/error.hpp"

namespace carillon::mesher {

/// Meshing method.
enum class Method {
  kAutomatic,  // kExtrusion for open sheets and for walls thinner than the element length; else kDelaunay, with kStuffing as fallback and a
               // note if it cuts thin places
  kDelaunay,   // CGAL Mesh_3: dihedral angles above about 12 degrees, sharp edges and thin tips kept
  kStuffing,   // isosurface stuffing on the distance field: faster, rounds sharp edges, cuts tips thinner than three cells
  kExtrusion,  // triangulated skin and one layer of prisms through the wall: a second or two, 12 nodes (order 2) per skin point
};

/// Axis of `height_m`.
enum class Axis { kX = 0, kY = 1, kZ = 2 };

/// Position of the given surface in the wall.
enum class Side { kAutomatic, kMiddle, kOutside, kInside };  // automatic: middle for an open surface, outside for a closed one

/// Meshing options. At most one of height_m and scale, and at most one of edge_m and nodes.
struct SurfaceOptions {
  std::filesystem::path surface = {};           // OBJ, STL (ASCII or binary), PLY (ASCII or binary), OFF
  std::optional<double> wall_m = std::nullopt;  // wall thickness; without it a closed surface is solid, an open one refused
  Side side = Side::kAutomatic;  // side of the wall given by the surface; anything but the outside of a closed one is extruded
  std::optional<double> height_m = std::nullopt;     // scales the surface to this extent along `up`
  Axis up = Axis::kY;                                // OBJ models conventionally stand along y; coordinates are never rotated
  std::optional<double> scale = std::nullopt;        // metres per unit of the file; default 1 without height_m
  std::optional<double> edge_m = std::nullopt;       // edge length of the tetrahedra
  std::optional<std::int64_t> nodes = std::nullopt;  // nodes of the final mesh (order 2: including mid-side nodes), within 10 %
  int order = 1;                                     // 1: four nodes per tetrahedron, 2: ten; 0: ten for an extruded wall, else four
  std::optional<double> close_holes = std::nullopt;  // largest hole to close, over the body's diagonal; default 0.15
  bool refuses_open = false;                         // refuse an open surface without wall_m instead of closing or wrapping it
  bool facets = false;                               // facets are the body, not samples of a smooth surface
  bool straight = false;                             // order 2: all mid-side nodes at edge midpoints, none on the true surface
  double sharp_angle_deg = 40;                       // larger turns between two faces, unless noise, stay sharp
  Method method = Method::kAutomatic;
  double sliver_deg = 12;  // kDelaunay: target dihedral angle of sliver removal (dominates the time of coarse meshes); 0: none
};

/// Result data, and repairs of the surface.
struct SurfaceReport {
  // Input surface, as read and repaired.
  std::int64_t input_vertices = 0;
  std::int64_t input_triangles = 0;
  std::int64_t removed_triangles = 0;                 // duplicates and degenerate ones
  std::int64_t flipped_triangles = 0;                 // reoriented outward
  std::int64_t unused_points = 0;                     // of the file, without a triangle; dropped
  std::int64_t seam_edges = 0;                        // borders joined with their neighbours
  double seam_m = 0;                                  // largest distance of joined points
  std::int64_t holes_closed = 0;                      // boundary loops filled with triangles
  double largest_hole_m = 0;                          // diameter; over the body's diagonal (circle of equal area); and the area
  double largest_hole_part = 0, holes_area_part = 0;  // area of all holes over that of the closed surface
  int facet_pieces = 1;                               // pieces per facet side to follow the smooth surface
  double doubt_m = 0;                                 // distance between facets and smooth surface where the body is ambiguous
  double smoothed_m = 0;                              // largest displacement by smoothing of a scan; 0: not a scan
  bool wrapped = false;                               // not repairable: the alpha wrap was meshed
  std::int64_t components = 0;                        // of the input surface after repairing
  double scale = 1;                                   // metres per unit of the file, as applied
  std::array<double, 3> extent_m{};                   // of the scaled surface along x, y, z
  double input_volume_m3 = 0;                         // enclosed by the scaled surface (with a wall: not of the shell)
  double input_area_m2 = 0;
  double sharp_edges_m = 0;  // total length of sharp edges kept
  std::int64_t sharp_curves = 0;

  // Mesh.
  Method method = Method::kDelaunay;  // method used
  std::int64_t nodes = 0;
  std::int64_t corner_nodes = 0;
  std::int64_t tets = 0;
  double edge_m = 0;                   // requested edge length
  double mean_edge_m = 0;              // result
  std::int64_t removed_tets = 0;       // at contacts of the body with itself, and fragments
  std::int64_t parted_nodes = 0;       // where two skins met
  int attempts = 0;                    // meshes made to meet the node count
  std::int64_t curved_edges = 0;       // order 2: edges with the mid node on the true surface
  std::int64_t straight_edges = 0;     // boundary edges left straight: no skin near enough
  std::int64_t straightened_tets = 0;  // elements made straight-sided to avoid folding
  double volume_m3 = 0;
  double expected_volume_m3 = 0;  // solid: input_volume_m3; with a wall: of the shell by the distance field
  double min_dihedral_deg = 0;
  double max_dihedral_deg = 0;
  double wall_min_m = 0, wall_mean_m = 0, wall_max_m = 0;  // distance of the inner skin's nodes from the input surface
  double layers_mean = 0;                                  // wall over mean edge length: approximate elements through the wall

  int layers = 0;            // prism layers of an extruded wall; 0: not extruded
  double edge_per_wall = 0;  // mean skin edge over mean thickness
  std::string reason;        // reason for the automatic choice; completes "by ... because"

  std::array<double, 3> mesh_extent_m{};  // of the mesh
  std::int64_t shells = 0;                // closed surfaces of the mesh boundary
  double farthest_outside_m = 0;          // largest distance of a node from the body

  std::vector<std::pair<std::string, double>> seconds;  // per phase, in order
  std::vector<std::string> notes;                       // sentences for the user: repairs and shortcomings
  std::vector<std::string> remarks;                     // other facts about a mesh that matches the file
};

/// Called with a short sentence at the start of each phase, and with "about N nodes" before the volume is meshed.
using Progress = std::function<void(std::string_view)>;

/// Meshes a surface. Tetrahedra are positively oriented, every node is used, the boundary is a closed 2-manifold (two boundary faces per
/// boundary edge), regions are 0, and equal inputs give equal meshes. The mesh is verified against the body (verify.hpp): volume, shells,
/// nodes outside. Throws InputError, with file and remedy, for an unreadable surface, no enclosed volume, too large a hole, a wall thicker
/// than the body, or a target count that cannot be met by a correct mesh; SystemError if memory runs out.
mesh::TetMesh mesh_surface(const SurfaceOptions& options, SurfaceReport& report, const Progress& progress = {});

/// For programs that mesh untrusted files: from now on a crash inside CGAL, or a mesh_surface that exceeds its processor time (repair 10 s,
/// mesh 12 s, plus 2 ms per triangle each, plus 5 ms per node), ends the process with exit code kExitInput and one line that begins with
/// `program` and names the step; with kExitSystem if an inherited limit (ulimit -t) was tighter. Sanitizers keep their own crash handling,
/// except for SIGFPE.
void guard_program(const char* program);

/// Report as text.
std::string describe(const SurfaceReport& report);

/// Contents of a surface file, before meshing.
struct SurfaceLook {
  std::int64_t triangles = 0;
  Vec3 extent{};                                   // in the file's units
  std::int64_t openings = 0;                       // borders of an open surface; 0: closed, or with holes small enough to close
  std::int64_t parts = 0;                          // separate bodies
  std::int64_t unused_points = 0, seam_edges = 0;  // as in SurfaceReport
  double thickness = 0.0;                          // of a wall given by both sides, in the file's units; 0: none
};

/// Throws InputError as read_surface().
SurfaceLook look_at_surface(const std::filesystem::path& surface);

}  // namespace carillon::mesher
