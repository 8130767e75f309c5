// Triangles that fill a polygon.
#pragma once

#include <vector>

#include "precompute/analytic/slabs.hpp"

namespace carillon::analytic {

/// A simple polygon, counter-clockwise, cut into triangles whose edges are at most `max_edge_m` long: ears are cut off, edges flipped to be
/// Delaunay's, and longest edges halved (Rivara 1984), which keeps angles above half of the least before. The first points are the corners,
/// those of the rim lie on its sides. No triangle has two of the corners that are `apart` (empty: none). Throws InputError when the polygon
/// is too thin for numbers of this precision, or for so many triangles.
Net triangulate(const std::vector<Point2>& corners_m, double max_edge_m, const std::vector<bool>& apart = {},
                std::size_t max_triangles = 400000);

/// Triangles about a point of the net are cut into `layers` rings, each `ratio` times as far from it as the one before: what resolves
/// r^alpha there.
void grade(Net& net, std::int32_t point, int layers, double ratio);

/// The inner angle of each corner [rad].
std::vector<double> calc_angles(const std::vector<Point2>& corners_m);

}  // namespace carillon::analytic
