// Triangulation of polygons.
#pragma once

#include <vector>

#include "precompute/analytic/slabs.hpp"

namespace carillon::analytic {

/// Triangulates a simple counter-clockwise polygon with edges of at most `max_edge_m`: ear clipping, Delaunay flips, then longest-edge
/// bisection (Rivara 1984), which keeps angles above half of the previous minimum. The first points are the corners; rim points lie on the
/// sides. No triangle has two of the corners in `apart` (empty: none). Throws InputError if the polygon is too thin for double precision or
/// for so many triangles.
Net triangulate(const std::vector<Point2>& corners_m, double max_edge_m, const std::vector<bool>& apart = {},
                std::size_t max_triangles = 400000);

/// Grades the triangles around a point into `layers` rings with radii in the ratio `ratio`, to resolve r^alpha.
void grade(Net& net, std::int32_t point, int layers, double ratio);

/// Inner angle of each corner [rad].
std::vector<double> calc_angles(const std::vector<Point2>& corners_m);

}  // namespace carillon::analytic
