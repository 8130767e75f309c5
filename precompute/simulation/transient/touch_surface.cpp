#include "precompute/simulation/transient/touch_surface.hpp"

#include <algorithm>
#include <limits>
#include <map>
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

TouchSurface make_touch_surface(std::span<const Vec3> rest_m, std::span<const std::array<std::int32_t, 3>> triangles,
                                std::span<const std::int32_t> body_of_triangle, std::span<const double> modulus_pa,
                                std::span<const double> reach_m, double kappa) {
  struct Sum {
    double area = 0, edge = 0;
    int edges = 0;
    std::int32_t body = 0;
  };
  std::map<std::int32_t, Sum> sums;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    std::array<Vec3, 3> at{};
    for (std::size_t c = 0; c < 3; ++c) at[c] = rest_m[triangles[t][c]];
    const double area = 0.5 * norm(cross(at[1] - at[0], at[2] - at[0]));
    for (std::size_t c = 0; c < 3; ++c) {
      Sum& sum = sums[triangles[t][c]];
      sum.area += area / 3.0;
      sum.edge += norm(at[(c + 1) % 3] - at[c]);
      ++sum.edges;
      sum.body = body_of_triangle[t];
    }
  }
  TouchSurface surface;
  std::map<std::int32_t, std::int32_t> number;
  for (const auto& [node, sum] : sums) {
    const std::size_t body = sum.body;
    number[node] = static_cast<std::int32_t>(surface.nodes.size());
    surface.nodes.push_back({node, sum.body, kappa * modulus_pa[body] * sum.area / (sum.edge / sum.edges), reach_m[body], rest_m[node]});
  }
  for (const auto& triangle : triangles) surface.triangles.push_back({number[triangle[0]], number[triangle[1]], number[triangle[2]]});
  return surface;
}

}  // namespace carillon::transient
