// All element faces, sorted. Internal header of check and boundary extraction.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::mesh {

struct Face {
  std::int32_t a, b, c;  // corners, ascending
  std::int32_t tet;
  std::int8_t local;  // 0..3, see kFaces
  bool odd;           // a b c run clockwise seen from outside the element
};

inline bool same_corners(const Face& x, const Face& y) { return x.a == y.a && x.b == y.b && x.c == y.c; }

/// All 4 E faces, equal ones adjacent. `node_of`: representative of each node (empty: identity).
std::vector<Face> sort_faces(const TetMesh& mesh, const std::vector<std::int32_t>& node_of = {});

/// Index into kEdges of the edge between local corners i and j.
int find_edge(int i, int j);

}  // namespace carillon::mesh
