// Nodes at which the outside of a mesh touches itself.
#pragma once

#include <functional>

#include "precompute/mesh/tet_mesh.hpp"
#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Makes the boundary a surface around every node: where a thin wall has a dent that reaches one node of its other skin, the dent is filled
/// with elements around a new node on its own skin; where no well-shaped ones fit, the elements of the node are removed. `project` gives
/// the nearest point of the body's skin, `is_on_skin` says whether that succeeded: no node is put anywhere else. Linear meshes that
/// make_manifold has seen. `components` as there. Returns how many nodes were repaired.
std::int64_t part_pinched_nodes(mesh::TetMesh& mesh, std::int64_t components, const std::function<Vec3(const Vec3&)>& project,
                                const std::function<bool(const Vec3&)>& is_on_skin);

}  // namespace carillon::mesher
