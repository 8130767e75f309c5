// Is a mesh fit to be computed on?  What can be repaired is repaired and counted, what cannot is refused with its elements named.
//
//   mesh::CheckReport report = mesh::check_mesh(mesh, "plate.msh");
//   for (const std::string& line : report.warnings) fmt::print("warning: {}\n", line);
//
// Elements and nodes are named by their position in the file (in the mesh as given), counting from 1. Serial, no MPI.
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

  // What was repaired.
  std::int64_t reoriented = 0;    // elements that were numbered inside out
  std::int64_t unreferenced = 0;  // nodes of no element, dropped
  std::int64_t welded = 0;        // nodes that were joined with another in the same place, closing a crack
  std::int64_t straightened = 0;  // quadratic elements whose curved edges folded them over, made straight-sided

  // What the mesh is.
  bool has_odd_size = false;                    // in a unit that is probably not the metre; the first of the warnings says so
  int components = 0;                           // parts that share no node
  std::vector<std::int32_t> component_of_node;  // (N), numbered by their first node
  std::int64_t boundary_faces = 0;              // element faces on the boundary
  std::int64_t pinched_nodes = 0;               // boundary nodes that join two parts of the body at a point only
  std::int64_t touching_nodes = 0;              // nodes in the place of another that were left apart (no common face)
  std::int64_t curved = 0;                      // quadratic elements with a mid node off the middle of its edge
  Vec3 box_low{};                               // [m]
  Vec3 box_high{};                              // [m]
  double volume_m3 = 0.0;

  // Quality of the straight-sided elements. Mean ratio (Liu and Joe 1994): 12 (3 V)^(2/3) / sum of squared edges; 1 regular, 0 flat.
  double min_dihedral_deg = 0.0;
  double max_dihedral_deg = 0.0;
  double mean_ratio_min = 0.0;
  double mean_ratio_1_percent = 0.0;  // one element in a hundred is worse
  double mean_ratio_mean = 0.0;
  double shortest_edge_m = 0.0;
  std::int64_t slivers = 0;  // elements with a dihedral angle under 5 or over 175 degrees

  std::vector<std::string> warnings;  // sentences for the user
};

/// Checks and repairs `mesh`; afterwards its elements are positively oriented, its nodes all used, its boundary is a closed edge manifold.
/// Nodes are renumbered when some were dropped or welded; node sets follow. `name` begins every message.
/// Throws InputError naming the first ten offenders, their number and the remedy: an element with a repeated node or without volume; an
/// element twice; two elements on the same side of their common face; a face of more than two elements; a boundary edge of other than two
/// boundary faces; quadratic elements that disagree about a mid node; indices out of range. The mesh is then in no defined state.
/// Not collective.
CheckReport check_mesh(TetMesh& mesh, const std::string& name = "mesh");

/// How many elements check_mesh would refuse as without volume.
std::int64_t count_flat(const TetMesh& mesh);

/// Several lines of text about the report, for the log.
std::string describe(const CheckReport& report);

/// The boundary of a volume mesh as triangles.
struct Surface {
  std::vector<std::int32_t> nodes;                     // (V) the mesh node of each surface vertex, ascending
  std::vector<std::array<std::int32_t, 3>> triangles;  // (T, 3) into `nodes`, counter-clockwise seen from outside
  std::vector<std::int32_t> tets;                      // (T) the element behind each triangle
};

/// The faces that belong to one element only; a face of a quadratic element gives four triangles through its mid nodes.
/// Pre: a mesh that check_mesh accepted.
Surface extract_boundary(const TetMesh& mesh);

/// The same body with mid nodes at the middles of the edges; a node set gains the mid nodes of the edges that have both corners in it.
TetMesh to_quadratic(const TetMesh& mesh);

/// The same body with the corners only; node sets keep those. A linear mesh is returned as it is.
TetMesh to_linear(const TetMesh& mesh);

/// How far apart two places in the box `low` .. `high` [m] may be and still be meant as one: 1e-9 of its diagonal, and not less than
/// coordinates of that size are rounded by when they are written and read.
double calc_place_tolerance(const Vec3& low, const Vec3& high);

/// The nodes of a named set. Throws InputError for an unknown name (listing those there are, and the nearest) and for an empty set.
std::vector<std::int32_t> find_fixed_nodes(const TetMesh& mesh, const std::string& set);

/// The nodes in the closed box low <= x <= high [m], widened by calc_place_tolerance so that nodes meant to lie on its faces count.
/// Throws InputError when there are none.
std::vector<std::int32_t> find_fixed_nodes(const TetMesh& mesh, const Vec3& low, const Vec3& high);

}  // namespace carillon::mesh
