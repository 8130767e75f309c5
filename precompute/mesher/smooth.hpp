// Improves the flattest elements by moving their nodes.
#pragma once

#include <functional>
#include <optional>

#include "precompute/mesh/tet_mesh.hpp"
#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Moves nodes of elements with a dihedral angle under `angle_deg` or over 180 - `angle_deg` to raise the worst surrounding angle. Inner
/// nodes move freely; boundary nodes are projected by `project` (empty: no move); nodes with `is_fixed` stay. Linear meshes, positively
/// oriented before and after. Returns the number of moved nodes.
std::int64_t better_flat_elements(mesh::TetMesh& mesh, double angle_deg, const std::function<std::optional<Vec3>(const Vec3&)>& project,
                                  const std::function<bool(const Vec3&)>& is_fixed);

}  // namespace carillon::mesher
