// Closed surfaces to tetrahedra: the solid, or the hollow shell between a surface and its inward offset.
//
// This is the one public header of the library; it is std only. CGAL (GPL-3) stays behind it, in
// this library and in the program carillon-mesh alone.
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

/// How the volume is filled.
enum class Method {
  kAutomatic,  // kExtrusion of open sheets, and of walls that are thinner than the elements are long; else kDelaunay, and where that
               // fails kStuffing, with a note if it cuts thin places
  kDelaunay,   // CGAL Mesh_3: no dihedral angle under about 12 degrees, sharp edges and thin tips kept
  kStuffing,   // isosurface stuffing on the distance field: faster, sharp edges are rounded, tips thinner than three cells are cut
  kExtrusion,  // the skin in triangles, and one layer of prisms through the wall: a second or two, 12 nodes (order 2) a point of the skin
};

/// The axis along which `height_m` is measured.
enum class Axis { kX = 0, kY = 1, kZ = 2 };

/// Which side of a wall the given surface is.
enum class Side { kAutomatic, kMiddle, kOutside, kInside };  // automatic: the middle of an open surface, the outside of a closed one

/// What to make of which surface. At most one of height_m and scale, and at most one of edge_m and nodes.
struct SurfaceOptions {
  std::filesystem::path surface = {};                // OBJ, STL (ASCII or binary), PLY (ASCII or binary), OFF
  std::optional<double> wall_m = std::nullopt;       // thickness of the wall; without it a closed surface is solid, an open one refused
  Side side = Side::kAutomatic;                      // of the wall, the given surface; others than the outside of a closed one are extruded
  std::optional<double> height_m = std::nullopt;     // scales the surface so that its extent along `up` is this
  Axis up = Axis::kY;                                // OBJ models stand along y by custom; the coordinates themselves are never turned
  std::optional<double> scale = std::nullopt;        // metres per unit of the file; without scale and height_m the file is in metres
  std::optional<double> edge_m = std::nullopt;       // length of the tetrahedra's edges
  std::optional<std::int64_t> nodes = std::nullopt;  // nodes of the final mesh (order 2: with the mid-side ones), met within 10 %
  int order = 1;                                     // 1: four nodes a tetrahedron, 2: ten; 0: ten where a wall is extruded, else four
  std::optional<double> close_holes = std::nullopt;  // largest hole that is closed, as a part of the body's diagonal; 0.15 without it
  bool refuses_open = false;                         // an open surface without wall_m is refused, neither closed nor wrapped
  bool facets = false;                               // the facets are the body, not samples of a smooth surface
  bool straight = false;                             // order 2: all mid-side nodes in the middle, none on the true surface
  double sharp_angle_deg = 40;                       // an edge whose two faces turn by more than this, and not by noise, stays sharp
  Method method = Method::kAutomatic;
  double sliver_deg = 12;  // kDelaunay: smaller dihedral angles are worked on, most of the time of a coarse mesh; 0: none are
};

/// What came out, and what had to be done to the surface for it.
struct SurfaceReport {
  // The input surface as it was read and repaired.
  std::int64_t input_vertices = 0;
  std::int64_t input_triangles = 0;
  std::int64_t removed_triangles = 0;  // duplicate or degenerate ones
  std::int64_t flipped_triangles = 0;  // turned so that all of them face outward
  std::int64_t unused_points = 0;      // of the file, without a triangle; dropped
  std::int64_t seam_edges = 0;         // borders joined with their neighbours
  double seam_m = 0;                   // largest distance of joined points
  std::int64_t holes_closed = 0;       // boundary loops filled with triangles
  double largest_hole_m = 0;           // across; as a part of the body's diagonal (the diameter of a circle of its area); and the area
  double largest_hole_part = 0, holes_area_part = 0;  // of all holes over that of the closed surface
  int facet_pieces = 1;              // into how many each facet's sides were cut to follow the smooth surface through its corners
  double doubt_m = 0;                // how far apart the facets and the smooth surface are where it is not known which is the body
  double smoothed_m = 0;             // largest displacement of a point when a scan was smoothed; 0: not a scan
  bool wrapped = false;              // the surface could not be repaired: its alpha wrap was meshed
  std::int64_t components = 0;       // of the input surface after repairing
  double scale = 1;                  // metres per unit of the file, as applied
  std::array<double, 3> extent_m{};  // of the scaled surface along x, y, z
  double input_volume_m3 = 0;        // enclosed by the scaled surface (with a wall: by the surface, not by the shell)
  double input_area_m2 = 0;
  double sharp_edges_m = 0;  // length of the edges of the input that were kept sharp
  std::int64_t sharp_curves = 0;

  // The mesh.
  Method method = Method::kDelaunay;  // the one that was used
  std::int64_t nodes = 0;
  std::int64_t corner_nodes = 0;
  std::int64_t tets = 0;
  double edge_m = 0;                   // the edge length asked of the mesher
  double mean_edge_m = 0;              // as it came out
  std::int64_t removed_tets = 0;       // where the body only touched itself, or crumbs
  std::int64_t parted_nodes = 0;       // at which two skins met
  int attempts = 0;                    // meshes made to meet the node count
  std::int64_t curved_edges = 0;       // order 2: edges whose mid node lies on the true surface, off the middle,
  std::int64_t straight_edges = 0;     // boundary edges with no skin near enough, left straight,
  std::int64_t straightened_tets = 0;  // and elements that would have folded over and were made straight-sided
  double volume_m3 = 0;
  double expected_volume_m3 = 0;  // solid: input_volume_m3; with a wall: that of the shell by the distance field
  double min_dihedral_deg = 0;
  double max_dihedral_deg = 0;
  double wall_min_m = 0, wall_mean_m = 0, wall_max_m = 0;  // distance of the inner skin's nodes to the input surface
  double layers_mean = 0;                                  // wall over mean edge length: about how many elements lie through the wall

  int layers = 0;            // of prisms through an extruded wall; 0: not extruded
  double edge_per_wall = 0;  // mean length of the skin's edges over the mean thickness
  std::string reason;        // why this method was chosen, where it was left open; the end of a sentence "by ... because"

  std::array<double, 3> mesh_extent_m{};  // of the mesh
  std::int64_t shells = 0;                // closed surfaces that the mesh's boundary consists of
  double farthest_outside_m = 0;          // a node's distance from the body

  std::vector<std::pair<std::string, double>> seconds;  // per phase, in the order they ran
  std::vector<std::string> notes;                       // sentences for the user: what was repaired, what fell short
  std::vector<std::string> remarks;                     // other facts about a mesh that matches the file
};

/// Called with a short sentence at the start of each phase. Two sentences are for programs, a word and a JSON object: "rough {...}" of the
/// surface as it was read, and "estimate {...}" of the repaired one, each with volume_m3, area_m2, thickness_m and nodes.
using Progress = std::function<void(std::string_view)>;

/// Meshes a surface. The tetrahedra are positively oriented, every node is used, the boundary is a closed 2-manifold
/// (every boundary edge has two boundary faces), and the same input gives the same mesh. Regions are all 0.
/// The mesh is compared with the body before it is returned (verify.hpp): its volume, its shells, how far its nodes lie outside.
/// Throws InputError, with the file and what to change, if the file cannot be read as a surface, if it encloses nothing or has too large a
/// hole, if the wall is thicker than the body, if the target count cannot be met or only by a mesh that is not the body; SystemError if
/// memory runs out.
mesh::TetMesh mesh_surface(const SurfaceOptions& options, SurfaceReport& report, const Progress& progress = {});

/// For a program that meshes files of strangers: from now on a crash inside CGAL, or a mesh_surface that takes far more processor time than
/// its size explains (its repair 10 s, the mesh 12 s, both and 2 ms a triangle, and 5 ms a node), ends the process with exit code
/// kExitInput and one line that begins with `program` and says at which step; with kExitSystem where the process came with a tighter limit
/// (ulimit -t). Under sanitizers crashes are left to them, but for SIGFPE.
void guard_program(const char* program);

/// The report as lines for a person.
std::string describe(const SurfaceReport& report);

/// Contents of a surface file, before meshing.
struct SurfaceLook {
  std::int64_t triangles = 0;
  Vec3 extent{};                                   // in the file's units
  std::int64_t openings = 0;                       // borders of an open surface; 0: closed, or holes small enough to close
  std::int64_t parts = 0;                          // separate bodies
  std::int64_t unused_points = 0, seam_edges = 0;  // as in SurfaceReport
  double thickness = 0.0;                          // of a wall given by both its sides, in the file's units; 0: none
};

/// Throws InputError as read_surface().
SurfaceLook look_at_surface(const std::filesystem::path& surface);

}  // namespace carillon::mesher
