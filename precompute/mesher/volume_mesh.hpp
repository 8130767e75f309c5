// Linear meshes of bodies between their skins, by Delaunay refinement or isosurface stuffing, and their smoothing.
#pragma once

#include <functional>
#include <optional>

#include "precompute/mesh/tet_mesh.hpp"
#include "precompute/mesher/body.hpp"
#include "precompute/mesher/distance_field.hpp"
#include "precompute/mesher/phases.hpp"
#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Fills the body of calc_body(field, wall_m, .) with tetrahedra of about the given edge length. Rounds sharp edges.
mesh::TetMesh stuff(const DistanceField& field, double wall_m, double edge_m);

/// Moves nodes of elements with a dihedral angle under `angle_deg` or over 180 - `angle_deg` to raise the worst surrounding angle. Inner
/// nodes move freely; boundary nodes are projected by `project` (empty: no move); nodes with `is_fixed` stay. Linear meshes, positively
/// oriented before and after. Returns the number of moved nodes.
std::int64_t better_flat_elements(mesh::TetMesh& mesh, double angle_deg, const std::function<std::optional<Vec3>(const Vec3&)>& project,
                                  const std::function<bool(const Vec3&)>& is_fixed);

/// Refuses a node count far below `min_nodes`, and bodies too thin to mesh without a count (InputError, CountRefusal).
void check_count(const SurfaceOptions& options, double min_nodes);

/// Mesh of the body (repaired, rounded, with its model); method and measures go to the report. edge_m: first edge of the search. Automatic
/// bodies fall back to stuffing if refinement does not end. Throws InputError if the mesh misrepresents the body, CountRefusal if the count
/// cannot be met.
mesh::TetMesh make_volume_mesh(Body& body, const SurfaceOptions& options, double edge_m, SurfaceReport& report, Phases& phases);

}  // namespace carillon::mesher
