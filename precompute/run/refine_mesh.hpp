// The same body with every tetrahedron cut into eight.
#pragma once

#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::run {

/// Cuts every tetrahedron into four at its corners and four of the octahedron between them, along the shortest of its diagonals; edges
/// become half as long. Elements of ten nodes keep their curved sides: new nodes lie where the quadratic map of the old element puts them.
/// Node sets gain the nodes whose old edge, or old face, is all in the set. Pre: a mesh that check_mesh accepted. Not collective.
mesh::TetMesh refine_mesh(const mesh::TetMesh& mesh);

}  // namespace carillon::run
