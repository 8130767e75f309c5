// Isosurface stuffing: tetrahedra from a distance field, on a lattice.
#pragma once

#include "precompute/mesh/tet_mesh.hpp"
#include "precompute/mesher/distance_field.hpp"

namespace carillon::mesher {

/// Fills the body of calc_body(field, wall_m, .) with tetrahedra of about the given edge length. Rounds sharp edges.
mesh::TetMesh stuff(const DistanceField& field, double wall_m, double edge_m);

}  // namespace carillon::mesher
