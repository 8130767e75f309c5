// Hierarchy of a surface's vertices.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "runtime/base/vector.hpp"

namespace carillon::packed {

/// Level (V) of each vertex, 0: coarsest, none empty. Vertices up to a level keep a minimum distance that halves with each level; the last
/// level has the remainder. The coarsest has at least kNeighbours vertices. `area_m2` > 0: area of the surface.
///
/// Method: dart throwing (Cook 1986): a vertex is taken if no taken one is within the level's distance.
std::vector<std::uint8_t> find_levels(std::span<const Vec3> vertices_m, double area_m2);

}  // namespace carillon::packed
