// How long edges may be along the sharp curves of a body.
#pragma once

#include <vector>

#include "precompute/mesher/triangle_surface.hpp"

namespace carillon::mesher {

/// A place on a curve and the longest edge that fits there.
struct SizedPoint {
  Vec3 place{};
  double size_m = 0;
};

/// Places on the curves, about half of edge_m apart, where another curve, or another stretch of the same one, passes nearer than edges of
/// edge_m need. Curves that end in a common point do not hinder each other. Empty if all curves lie far enough apart.
std::vector<SizedPoint> calc_curve_sizes(const std::vector<Polyline>& curves, double edge_m);

/// How far p lies from the nearest curve; infinity if there is none.
double calc_distance(const std::vector<Polyline>& curves, const Vec3& p);

/// The longest edge at p: at most edge_m, and growing away from the narrow places by half the distance.
double calc_size(const std::vector<SizedPoint>& narrow, double edge_m, const Vec3& p);

}  // namespace carillon::mesher
