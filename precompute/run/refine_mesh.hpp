// Uniform refinement of a tetrahedral mesh.
#pragma once

#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::run {

/// Cuts every tetrahedron into eight: four corner tetrahedra and four from the inner octahedron, cut along its shortest diagonal. Ten-node
/// elements keep their curved sides: new nodes are on the quadratic map of the old element. Node sets gain the nodes whose old edge or face
/// is entirely in the set. Pre: a mesh accepted by check_mesh. Not collective.
mesh::TetMesh refine_mesh(const mesh::TetMesh& mesh);

}  // namespace carillon::run
