// Walls given as closed surfaces.
#pragma once

#include <optional>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Two sides of a wall, without the rim between them.
struct TwoSides {
  TriangleSurface outer, inner;  // facing away from each other
  double thickness_m = 0;        // median
};

/// Sides of a closed surface that is the skin of a thin wall. Empty if more than a small part of the surface has no opposite side within a
/// fifth of the diagonal, or if the sides do not face each other.
std::optional<TwoSides> find_two_sides(const TriangleSurface& closed);

}  // namespace carillon::mesher
