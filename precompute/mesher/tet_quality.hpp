// Operations on tetrahedral meshes of any origin: measures, boundary, repair, second order. Std only.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "precompute/mesh/tet_mesh.hpp"
#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

struct TetMeasures {
  double min_dihedral_deg = 180, max_dihedral_deg = 0;
  double volume_m3 = 0;
  double mean_edge_m = 0;  // over element edges, counted once per element
};
TetMeasures measure(const mesh::TetMesh& mesh);

/// Straight or curved elements [m3].
double calc_mesh_volume(const mesh::TetMesh& mesh);

/// Faces of a single element, counter-clockwise seen from outside.
std::vector<Triangle> find_boundary(const mesh::TetMesh& mesh);

/// For closed surfaces that may touch: number of edges without exactly two faces and of nodes with several fans. 0: a manifold.
std::int64_t count_pinches(const std::vector<Triangle>& faces);

/// Number of distinct edges; plus corner nodes, the count of the second-order mesh.
std::int64_t count_edges(const mesh::TetMesh& mesh);

/// Removes elements until every boundary edge has two boundary faces, the elements at each node are connected by faces around it, and at
/// most `components` pieces are left (the largest). Removes unused nodes. Linear meshes. Returns the number of removed elements.
std::int64_t make_manifold(mesh::TetMesh& mesh, std::int64_t components);

/// Removes marked elements, and nodes that become unused. Linear meshes.
void drop_elements(mesh::TetMesh& mesh, const std::vector<char>& remove);

/// Removes zero-volume elements with corners in a boundary plane, as refinement leaves them next to sharp edges: flips the boundary
/// diagonal. Linear meshes. Returns the number of removed elements.
std::int64_t peel_flat_elements(mesh::TetMesh& mesh);

/// Smallest of all dihedral angles of a tetrahedron and of 180 degrees minus them, in degrees; negative if inverted.
double calc_flatness(const std::array<Vec3, 4>& corners);

}  // namespace carillon::mesher
