// The surface of a body: its box, its normals, and which of its triangles face the open air.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/base/triangle.hpp"

namespace carillon::bank {

/// Twice the area times the unit normal of a triangle [m^2].
Vec3 calc_normal(const std::vector<Vec3>& vertices_m, const Triangle& triangle);

/// The lowest and the highest corner of the box around the vertices of a bank that has some [m].
std::array<Vec3, 2> find_extent(const std::vector<Vec3>& vertices_m);

/// Twice the volume over the area of all triangles [m]: the thickness of a sheet or a wall; of a rod half its diameter, of a ball two
/// thirds of its radius. 0 without volume or area.
double calc_thickness_m(const std::vector<Vec3>& vertices_m, const std::vector<Triangle>& triangles, double volume_m3);

/// The triangles that face the open air, in their order: those of closed shells (connected through edges) that enclose a positive volume.
/// The wall of a closed cavity encloses a negative one; it moves air that cannot get out. A body open to the outside, such as a bowl, is
/// one shell. Indices must lie inside `vertices_m`. Pure; any thread.
std::vector<Triangle> find_outer_triangles(const std::vector<Vec3>& vertices_m, const std::vector<Triangle>& triangles);

}  // namespace carillon::bank
