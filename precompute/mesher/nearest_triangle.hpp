// Distances from the points of a grid to their nearest triangle.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Fills `distance` (a grid of size[0] x size[1] x size[2], x fastest) with the distance in voxels of each grid point (i, j, k) to the
/// surface, whose points are in units of voxels from the grid's origin. Points farther off than reach[inside[n]] voxels keep what they
/// hold. `inside`: 0 or 1 for every point.
void fill_distances(const TriangleSurface& surface, const std::array<std::int32_t, 3>& size, const std::vector<char>& inside,
                    const std::array<double, 2>& reach, std::vector<float>& distance);

}  // namespace carillon::mesher
