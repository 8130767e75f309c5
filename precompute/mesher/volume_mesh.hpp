// Linear meshes of bodies between their skins, by Delaunay refinement or isosurface stuffing.
#pragma once

#include "precompute/mesh/tet_mesh.hpp"
#include "precompute/mesher/body.hpp"
#include "precompute/mesher/phases.hpp"

namespace carillon::mesher {

/// Refuses a node count far below `min_nodes`, and bodies too thin to mesh without a count (InputError, CountRefusal).
void check_count(const SurfaceOptions& options, double min_nodes);

/// Mesh of the body (repaired, rounded, with its model); method and measures go to the report. edge_m: first edge of the search. Automatic
/// bodies fall back to stuffing if refinement does not end. Throws InputError if the mesh misrepresents the body, CountRefusal if the count
/// cannot be met.
mesh::TetMesh make_volume_mesh(Body& body, const SurfaceOptions& options, double edge_m, SurfaceReport& report, Phases& phases);

}  // namespace carillon::mesher
