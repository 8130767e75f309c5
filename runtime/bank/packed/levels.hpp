// Which vertices of a surface come first.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "runtime/base/vector.hpp"

namespace carillon::packed {

/// The level (V) of each vertex, 0 for the coarsest, none empty: vertices of a level and of those before it keep a distance from each other
/// that halves with each level, and the last level has what remains. The coarsest has kNeighbours or more vertices. `area_m2` > 0 of the
/// surface that they lie on.
///
/// Method: each vertex in turn is taken if no vertex that was taken is nearer than the level's distance (dart throwing, Cook 1986).
std::vector<std::uint8_t> find_levels(std::span<const Vec3> vertices_m, double area_m2);

}  // namespace carillon::packed
