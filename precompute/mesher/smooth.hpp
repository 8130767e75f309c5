// Betters the flattest elements of a mesh by moving their nodes.
#pragma once

#include <functional>
#include <optional>

#include "precompute/mesh/tet_mesh.hpp"
#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Moves nodes of elements that have a dihedral angle under `angle_deg` or over 180 - `angle_deg`, where that raises the worst angle
/// around the node. Inner nodes move freely; those of the boundary are brought back to it by `project`, which gives nothing where it finds
/// no way; those for which `is_fixed` is true stay. Linear meshes, positively oriented before and after. Returns how many nodes were moved.
std::int64_t better_flat_elements(mesh::TetMesh& mesh, double angle_deg, const std::function<std::optional<Vec3>(const Vec3&)>& project,
                                  const std::function<bool(const Vec3&)>& is_fixed);

}  // namespace carillon::mesher
