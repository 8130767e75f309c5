// The last step to the smooth surface.
#pragma once

#include "precompute/mesh/tet_mesh.hpp"
#include "precompute/mesher/body.hpp"

namespace carillon::mesher {

/// Moves the nodes of both skins from the triangles of body.repaired.surface, where the mesher put them, to the smooth surface body.round;
/// mid-side nodes inside follow the ends of their edges. With `straight`, all mid-side nodes do. Elements that this would turn inside out
/// keep their nodes (of ten nodes: their straight sides). Where the facets leave it open what they are, mesh.doubt_m says by how much.
/// Returns the number of elements made straight. Nothing to do without body.round.
std::int64_t place_on_smooth_surface(mesh::TetMesh& mesh, const Body& body, bool straight);

/// Largest doubt of the nodes into the report, with a remark on coarse facets.
void remark_doubt(const mesh::TetMesh& mesh, SurfaceReport& report);

}  // namespace carillon::mesher
