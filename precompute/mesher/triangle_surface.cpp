// Measures of a triangle surface.
#include "precompute/mesher/triangle_surface.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace carillon::mesher {

double norm(const Vec3& a) { return std::sqrt(dot(a, a)); }

Box calc_box(const std::vector<Vec3>& points) {
  constexpr double kHuge = std::numeric_limits<double>::max();
  Box box{{kHuge, kHuge, kHuge}, {-kHuge, -kHuge, -kHuge}};
  for (const Vec3& p : points)
    for (int c = 0; c < 3; ++c) {
      box.low[c] = std::min(box.low[c], p[c]);
      box.high[c] = std::max(box.high[c], p[c]);
    }
  return box;
}

double calc_volume(const TriangleSurface& surface) {
  // Relative to a point of the surface, so that a body far from the origin loses no digits.
  const Vec3 origin = surface.points.empty() ? Vec3{} : surface.points.front();
  double sum = 0;
  for (const Triangle& t : surface.triangles)
    sum += dot(surface.points[t[0]] - origin, cross(surface.points[t[1]] - origin, surface.points[t[2]] - origin));
  return sum / 6;
}

double calc_area(const TriangleSurface& surface) {
  double sum = 0;
  for (const Triangle& t : surface.triangles)
    sum += norm(cross(surface.points[t[1]] - surface.points[t[0]], surface.points[t[2]] - surface.points[t[0]]));
  return sum / 2;
}

}  // namespace carillon::mesher
