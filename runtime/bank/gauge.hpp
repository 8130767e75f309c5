// Strain of a bank's surface.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

/// Weights (row, weight) [1/m] whose sum over a displacement (V, 3) of the surface, row 3 v + axis, is the normal strain at a point of a
/// triangle along the projection of a unit direction on the surface. Throws InputError for a triangle without area and a direction normal
/// to it.
///
/// Method: displacements along the direction are fitted by a cubic in the tangential plane, over up to five rings of vertices of the same
///   face within 2.5 % of the body's size; the strain is its slope. Shapes are quantised: differences in a single triangle scatter by
///   percents. On coarse meshes the mean over the triangles about each corner, linear between the corners.
/// Source: for the mean, strain of linear triangles: the gradient of the barycentric coordinates.
std::vector<std::pair<std::size_t, double>> calc_strain_weights(const Bank& bank, std::int32_t triangle, const Vec3& barycentric,
                                                                const Vec3& direction);

}  // namespace carillon::bank
