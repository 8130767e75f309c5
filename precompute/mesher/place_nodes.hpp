// Final projection onto the smooth surface.
#pragma once

#include "precompute/mesh/tet_mesh.hpp"
#include "precompute/mesher/body.hpp"

namespace carillon::mesher {

/// Moves the nodes of both skins from the triangles of body.repaired.surface to the smooth surface body.round; inner mid-side nodes follow
/// their edge ends (with `straight`, all mid-side nodes do). Elements that would invert keep their nodes (ten nodes: straight sides). Where
/// the facets are ambiguous, mesh.doubt_m gets the offset. Returns the number of straightened elements. No-op without body.round.
std::int64_t place_on_smooth_surface(mesh::TetMesh& mesh, const Body& body, bool straight);

/// Reports the largest doubt of the nodes, with a remark on coarse facets.
void remark_doubt(const mesh::TetMesh& mesh, SurfaceReport& report);

}  // namespace carillon::mesher
