// How far the surface of the mesh lies from the smooth surface that its vertices seem to come from.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "precompute/mesh/distributed/distributed_mesh.hpp"

namespace carillon::error_bars {

/// One edge of a face of the body's surface. The gap between the mesh and the smooth surface is, on a face, sum over its edges of
/// 4 L_a L_b gap, so that its integral is area / 3 * gap for each edge.
struct SurfaceEdge {
  std::int32_t tet = 0;   // local element
  std::int8_t edge = 0;   // of mesh::kEdges
  bool is_fixed = false;  // on a face whose nodes are all fixed
  double gap_m = 0.0;     // at the middle of the edge, outwards
  double third_m2 = 0.0;  // a third of the face's area
};

/// A face of the surface on which nothing is fixed, so that no traction acts on it.
struct FreeFace {
  std::int32_t tet = 0;          // local element
  std::int8_t face = 0;          // of mesh::kFaces
  std::array<Vec3, 3> normal{};  // unit, of the smooth surface, in the middles of its edges
  double area_m2 = 0.0;
  double height_m = 0.0;  // of the element over it
};

struct Surface {
  std::vector<SurfaceEdge> edges;
  std::vector<FreeFace> free_faces;
  /// (nodes) 1 where stresses have no limit, so that errors fall slowly: the vertices of edges at which the surface turns inwards by more
  /// than 50 degrees, and of those that part a fixed face from a free one. Whichever rank has the faces.
  std::vector<char> is_singular;
  std::vector<char> is_outer;  // (nodes) 1 at corners of faces of the surface, whichever rank has them
  /// (nodes) by how much of the height of the elements the smooth surface rises above the chords of its edges, the most there; 0 inside
  /// and where it is flat. Whichever rank has the faces.
  std::vector<float> bend;
};

/// The surface faces of this rank's elements. Faces that meet at less than 50 degrees belong to one smooth surface; at sharper edges each
/// side is smooth by itself. Collective.
Surface find_surface(const comm::Communicator& comm, const mesh::LocalMesh& local);

/// The edges of the surface with the way to the surface that the body may have as well (TetMesh::doubt_m), in `gap_m`; those without doubt
/// are left out. Collective.
std::vector<SurfaceEdge> find_doubtful_edges(const comm::Communicator& comm, const mesh::LocalMesh& local);

}  // namespace carillon::error_bars
