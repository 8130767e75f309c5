// Surface of a body: bounding box, normals, outer triangles.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/base/triangle.hpp"

namespace carillon::bank {

/// Normal of a triangle with length twice its area [m^2].
Vec3 calc_normal(const std::vector<Vec3>& vertices_m, const Triangle& triangle);

/// Bounding box (lowest, highest corner) of a non-empty set of vertices [m].
std::array<Vec3, 2> find_extent(const std::vector<Vec3>& vertices_m);

/// Thickness [m]: twice the volume over the area of all triangles. Exact for sheets and walls; half the diameter of a rod, two thirds of
/// the radius of a ball. 0 without volume or area.
double calc_thickness_m(const std::vector<Vec3>& vertices_m, const std::vector<Triangle>& triangles, double volume_m3);

/// Triangles facing the open air, in order: those of closed shells (connected through edges) with positive enclosed volume. Walls of closed
/// cavities enclose a negative one. A body open to the outside, such as a bowl, is one shell. Indices must be valid. Thread-safe.
std::vector<Triangle> find_outer_triangles(const std::vector<Vec3>& vertices_m, const std::vector<Triangle>& triangles);

}  // namespace carillon::bank
