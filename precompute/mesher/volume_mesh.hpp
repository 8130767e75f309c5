// Linear meshes of bodies between their skins, by Delaunay refinement or isosurface stuffing.
#pragma once

#include "precompute/mesh/tet_mesh.hpp"
#include "precompute/mesher/body.hpp"
#include "precompute/mesher/phases.hpp"

namespace carillon::mesher {

/// Refuses a node count far below `min_nodes`, and bodies so thin that without a count they need too many (InputError, CountRefusal).
void check_count(const SurfaceOptions& options, double min_nodes);

/// The mesh of the body, with its method and measures in the report; body: repaired, rounded, with its model. edge_m: first edge of the
/// search. Stuffs automatic bodies on which refinement does not end. Throws InputError if the mesh is not the body, CountRefusal if the
/// count cannot be met.
mesh::TetMesh make_volume_mesh(Body& body, const SurfaceOptions& options, double edge_m, SurfaceReport& report, Phases& phases);

}  // namespace carillon::mesher
