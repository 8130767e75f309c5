// Admissible edge lengths along the sharp curves of a body.
#pragma once

#include <vector>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// A point on a curve and the longest edge allowed there.
struct SizedPoint {
  Vec3 place{};
  double size_m = 0;
};

/// Points on the curves, about half of edge_m apart, where another curve, or another stretch of the same one, is nearer than edges of
/// edge_m allow. Curves with a common end do not conflict there. Empty if all curves are far enough apart.
std::vector<SizedPoint> calc_curve_sizes(const std::vector<Polyline>& curves, double edge_m);

/// Distance of p from the nearest curve; infinity if there is none.
double calc_distance(const std::vector<Polyline>& curves, const Vec3& p);

/// Longest edge at p: at most edge_m, growing with half the distance from the narrow points.
double calc_size(const std::vector<SizedPoint>& narrow, double edge_m, const Vec3& p);

}  // namespace carillon::mesher
