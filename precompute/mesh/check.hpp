// Mesh validation and repair: repairs defects where possible and counts them; otherwise refuses the mesh and names the elements.
//
//   mesh::CheckReport report = mesh::check_mesh(mesh, "plate.msh");
//   for (const std::string& line : report.warnings) fmt::print("warning: {}\n", line);
//
// Elements and nodes are named by their position in the input mesh, counted from 1. Serial, no MPI.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::mesh {

struct CheckReport {
  std::int64_t nodes = 0;  // after the repair
  std::int64_t tets = 0;
  int order = 1;

  // Repairs.
  std::int64_t reoriented = 0;    // inverted elements
  std::int64_t unreferenced = 0;  // dropped
  std::int64_t welded = 0;        // merged with a coincident node, closing a crack
  std::int64_t straightened = 0;  // quadratic elements folded by their curved edges

  // Properties.
  bool has_odd_size = false;                    // unit is probably not the metre; then the first warning says so
  int components = 0;                           // connected parts
  std::vector<std::int32_t> component_of_node;  // (N), numbered by first node
  std::int64_t boundary_faces = 0;              // element faces on the boundary
  std::int64_t pinched_nodes = 0;               // boundary nodes that connect two parts only at a point
  std::int64_t touching_nodes = 0;              // coincident nodes left apart (no common face)
  std::int64_t curved = 0;                      // quadratic elements with a mid node off its edge's middle
  Vec3 box_low{};                               // [m]
  Vec3 box_high{};                              // [m]
  double volume_m3 = 0.0;

  // Quality of the straight-sided elements. Mean ratio (Liu and Joe 1994): 12 (3 V)^(2/3) / sum of squared edges; 1 regular, 0 flat.
  double min_dihedral_deg = 0.0;
  double max_dihedral_deg = 0.0;
  double mean_ratio_min = 0.0;
  double mean_ratio_1_percent = 0.0;  // first percentile
  double mean_ratio_mean = 0.0;
  double shortest_edge_m = 0.0;
  std::int64_t slivers = 0;  // elements with a dihedral angle under 5 or over 175 degrees

  std::vector<std::string> warnings;  // sentences for the user
};

/// Checks and repairs `mesh`: afterwards elements are positively oriented, every node is used and the boundary is a closed edge manifold.
/// Dropping or welding renumbers nodes, and node sets follow. `name` begins every message. Throws InputError with the first ten offenders,
/// their number and the remedy: repeated node in an element, zero volume, duplicate element, two elements on the same side of a face, face
/// of more than two elements, boundary edge without exactly two boundary faces, contradictory mid nodes, index out of range. `mesh` is then
/// unspecified.
/// Not collective.
CheckReport check_mesh(TetMesh& mesh, const std::string& name = "mesh");

/// Number of elements that check_mesh would refuse for zero volume.
std::int64_t count_flat(const TetMesh& mesh);

/// Report as several lines of text, for the log.
std::string describe(const CheckReport& report);

/// Boundary of a volume mesh as triangles.
struct Surface {
  std::vector<std::int32_t> nodes;                     // (V) mesh node of each surface vertex, ascending
  std::vector<std::array<std::int32_t, 3>> triangles;  // (T, 3) into `nodes`, counter-clockwise seen from outside
  std::vector<std::int32_t> tets;                      // (T) element behind each triangle
};

/// Faces of a single element; a face of a quadratic element gives four triangles through its mid nodes.
/// Pre: accepted by check_mesh.
Surface extract_boundary(const TetMesh& mesh);

/// Quadratic mesh with mid nodes at the edge midpoints; node sets gain the mid nodes of edges with both corners in the set.
TetMesh to_quadratic(const TetMesh& mesh);

/// Linear mesh of the corners; node sets keep their corners. A linear mesh is returned unchanged.
TetMesh to_linear(const TetMesh& mesh);

/// Distance [m] within which positions in the box `low` .. `high` [m] count as equal: 1e-9 of the diagonal, at least the rounding error of
/// coordinates of that size.
double calc_place_tolerance(const Vec3& low, const Vec3& high);

/// Nodes of a named set. Throws InputError for an unknown name (listing the known ones and the nearest) and for an empty set.
std::vector<std::int32_t> find_fixed_nodes(const TetMesh& mesh, const std::string& set);

/// Nodes in the closed box low <= x <= high [m], widened by calc_place_tolerance to include nodes on its faces. Throws InputError if there
/// are none.
std::vector<std::int32_t> find_fixed_nodes(const TetMesh& mesh, const Vec3& low, const Vec3& high);

}  // namespace carillon::mesh
