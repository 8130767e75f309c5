// Transfer of velocities from a fine surface to a coarse one.
#pragma once

#include <vector>

#include "precompute/air/solve.hpp"

namespace carillon::air {

/// Velocities `fine` on the surface of `nodes_m` and `triangles`, transferred to a surface close to it. Linear least-squares fit on each
/// coarse facet; each facet keeps its flux, and so does the body. Coarse facets without nearest fine points stay at rest.
Radiator transfer(const Radiator& fine, std::vector<Vec3> nodes_m, std::vector<Triangle> triangles);

}  // namespace carillon::air
