// What a mesher does with tetrahedra of whatever origin: measures, boundary, repair, second order. Std only.
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
  double mean_edge_m = 0;  // over the elements' edges, each counted as often as it has elements
};
TetMeasures measure(const mesh::TetMesh& mesh);

/// Of straight or curved elements [m3].
double calc_mesh_volume(const mesh::TetMesh& mesh);

/// Faces that belong to one element, counter-clockwise seen from outside.
std::vector<Triangle> find_boundary(const mesh::TetMesh& mesh);

/// Of closed surfaces that may touch: the edges that do not belong to two faces, and the nodes at which the faces make several fans that
/// share no edge. 0: a manifold.
std::int64_t count_pinches(const std::vector<Triangle>& faces);

/// Number of different edges, so corner nodes plus this is the count of the second-order mesh.
std::int64_t count_edges(const mesh::TetMesh& mesh);

/// Removes elements until every boundary edge has two boundary faces, no node joins elements that do not hang together by faces
/// around it, and no more than `components` pieces are left (the largest ones). Removes unused nodes. Linear meshes. Returns how many
/// elements went.
std::int64_t make_manifold(mesh::TetMesh& mesh, std::int64_t components);

/// Removes the elements that are marked, and the nodes that nothing uses then. Linear meshes.
void drop_elements(mesh::TetMesh& mesh, const std::vector<char>& remove);

/// Removes elements without volume whose corners lie in a plane of the boundary, as refinement leaves them next to sharp edges: the
/// boundary has the other diagonal then. Linear meshes. Returns how many elements went.
std::int64_t peel_flat_elements(mesh::TetMesh& mesh);

/// The smallest of all dihedral angles of a tetrahedron and of 180 degrees minus them, in degrees; negative if it is inverted.
double calc_flatness(const std::array<Vec3, 4>& corners);

}  // namespace carillon::mesher
