// Distances from grid points to their nearest triangle.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <vector>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// Fills `distance` (a grid of size[0] x size[1] x size[2], x fastest) with the distance in voxels of each grid point (i, j, k) to the
/// surface, given in voxels from the grid origin. Points farther than reach[inside[n]] voxels keep their value. `inside`: 0 or 1 per point.
void fill_distances(const TriangleSurface& surface, const std::array<std::int32_t, 3>& size, const std::vector<char>& inside,
                    const std::array<double, 2>& reach, std::vector<float>& distance);

}  // namespace carillon::mesher
