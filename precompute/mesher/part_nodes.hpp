// Repairs nodes at which the boundary touches itself.
#pragma once

#include <functional>

#include "precompute/mesh/tet_mesh.hpp"
#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Makes the boundary a surface around every node: where a dent of a thin wall touches one node of its other skin, elements around a new
/// node on its own skin fill the dent; if none of good shape fit, the node's elements are removed. `project` gives the nearest skin point,
/// `is_on_skin` its success: new nodes lie on the skin only. For linear meshes after make_manifold; `components` as there. Returns the
/// number of repaired nodes.
std::int64_t part_pinched_nodes(mesh::TetMesh& mesh, std::int64_t components, const std::function<Vec3(const Vec3&)>& project,
                                const std::function<bool(const Vec3&)>& is_on_skin);

}  // namespace carillon::mesher
