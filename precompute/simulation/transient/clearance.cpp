#include "precompute/simulation/transient/clearance.hpp"

#include <algorithm>
#include <limits>
#include <variant>

namespace carillon::transient {

Clearance find_clearance(const RigidObstacle& obstacle, const Vec3& p) {
  if (const auto* plane = std::get_if<job::PlaneObstacle>(&obstacle)) return {dot(p - plane->point_m, plane->normal), plane->normal};
  if (const auto* ball = std::get_if<job::BallObstacle>(&obstacle)) {
    const Vec3 way = p - ball->centre_m;
    const double size = norm(way);
    return {size - ball->radius_m, size > 0 ? (1.0 / size) * way : Vec3{0, 0, 1}};
  }
  const auto& box = std::get<job::BoxObstacle>(obstacle);
  Vec3 outside{};
  double inside = -std::numeric_limits<double>::infinity();
  Vec3 nearest_face{};
  for (std::size_t k = 0; k < 3; ++k) {
    const double low = box.min_m[k] - p[k], high = p[k] - box.max_m[k], beyond = std::max(low, high);
    if (beyond > 0) outside[k] = low > 0 ? -low : high;
    if (beyond > inside) {
      inside = beyond;
      nearest_face = {};
      nearest_face[k] = low > high ? -1.0 : 1.0;
    }
  }
  const double size = norm(outside);
  if (size > 0) return {size, (1.0 / size) * outside};
  return {inside, nearest_face};
}

}  // namespace carillon::transient
