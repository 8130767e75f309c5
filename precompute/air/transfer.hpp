// Velocities from a fine surface to a coarse one.
#pragma once

#include <vector>

#include "precompute/air/solve.hpp"

namespace carillon::air {

/// `fine` on the surface of `nodes_m` and `triangles`, which lies close to its own. On each coarse facet the velocity is the linear one
/// nearest to the fine one there, in the mean square; each facet keeps its flow, so that the body does. A coarse facet that no part of the
/// fine surface is nearest to stays at rest.
Radiator transfer(const Radiator& fine, std::vector<Vec3> nodes_m, std::vector<Triangle> triangles);

}  // namespace carillon::air
