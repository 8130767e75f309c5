// Distance between the mesh surface and the smooth surface implied by its vertices.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "precompute/mesh/distributed/distributed_mesh.hpp"

namespace carillon::error_bars {

/// One edge of a surface face. The gap between mesh and smooth surface on a face is the sum over its edges of 4 L_a L_b gap, with integral
/// area / 3 * gap per edge.
struct SurfaceEdge {
  std::int32_t tet = 0;   // local element
  std::int8_t edge = 0;   // index into mesh::kEdges
  bool is_fixed = false;  // on a face whose nodes are all fixed
  double gap_m = 0.0;     // at the middle of the edge, outwards
  double third_m2 = 0.0;  // a third of the face's area
};

/// A traction-free face without fixed nodes.
struct FreeFace {
  std::int32_t tet = 0;          // local element
  std::int8_t face = 0;          // of mesh::kFaces
  std::array<Vec3, 3> normal{};  // unit, of the smooth surface, at the middles of its edges
  double area_m2 = 0.0;
  double height_m = 0.0;  // of the element over it
};

/// Edges with singular stress.
enum Singular : char {
  kRim = 1,     // between fixed and free faces
  kInward = 2,  // inward, sharper than 50 degrees
};

struct Surface {
  std::vector<SurfaceEdge> edges;
  std::vector<SurfaceEdge> doubts;  // gap to the round surface that faces turning by 50 to 80 degrees may stand for
  std::vector<FreeFace> free_faces;
  /// (nodes) bits of Singular at stress singularities, where errors converge slowly. Complete on every rank.
  std::vector<char> singular;
  std::vector<char> is_outer;  // (nodes) 1 at corners of surface faces, complete on every rank
  /// (nodes) largest rise of the smooth surface above the chords of the adjacent edges, relative to the height of the elements; 0 inside
  /// and on flat parts. Complete on every rank.
  std::vector<float> bend;
};

/// Surface faces of this rank's elements. Faces that meet at less than 50 degrees belong to one smooth surface; sharper edges separate
/// surfaces. Collective.
Surface find_surface(const comm::Communicator& comm, const mesh::LocalMesh& local);

/// Edges of the surface with the distance to the alternative surface (TetMesh::doubt_m) in `gap_m`; unambiguous edges are omitted.
/// Collective.
std::vector<SurfaceEdge> find_doubtful_edges(const comm::Communicator& comm, const mesh::LocalMesh& local);

}  // namespace carillon::error_bars
