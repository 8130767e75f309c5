// Method:     the nearest point of a triangle by its Voronoi regions (corners, edges, face), over all triangles.
// Source:     Ericson, Real-Time Collision Detection (2005), section 5.1.5.
// Deviations: none.
#include "runtime/host/strikes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace carillon::host {
namespace {

constexpr double kFarthestShare = 0.25;  // of the body's extent: how far beside the surface a point may lie

double dot(const Vec3& a, const Vec3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vec3 subtract(const Vec3& a, const Vec3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }

/// Barycentric coordinates of the point of the triangle (a, b, c) that is nearest to p.
Vec3 find_nearest_barycentric(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) {
  const Vec3 ab = subtract(b, a), ac = subtract(c, a);
  const Vec3 ap = subtract(p, a), bp = subtract(p, b), cp = subtract(p, c);
  const double d1 = dot(ab, ap), d2 = dot(ac, ap), d3 = dot(ab, bp), d4 = dot(ac, bp), d5 = dot(ab, cp), d6 = dot(ac, cp);
  if (d1 <= 0.0 && d2 <= 0.0) return {1.0, 0.0, 0.0};
  if (d3 >= 0.0 && d4 <= d3) return {0.0, 1.0, 0.0};
  const double over_ab = d1 * d4 - d3 * d2;
  if (over_ab <= 0.0 && d1 >= 0.0 && d3 <= 0.0) return {1.0 - d1 / (d1 - d3), d1 / (d1 - d3), 0.0};
  if (d6 >= 0.0 && d5 <= d6) return {0.0, 0.0, 1.0};
  const double over_ac = d5 * d2 - d1 * d6;
  if (over_ac <= 0.0 && d2 >= 0.0 && d6 <= 0.0) return {1.0 - d2 / (d2 - d6), 0.0, d2 / (d2 - d6)};
  const double over_bc = d3 * d6 - d5 * d4;
  if (over_bc <= 0.0 && d4 >= d3 && d5 >= d6) {
    const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return {0.0, 1.0 - w, w};
  }
  const double sum = over_ab + over_ac + over_bc;
  return {over_bc / sum, over_ac / sum, over_ab / sum};
}

/// The triangle and the place on it that are nearest to the strike's point.
void find_nearest_place(const bank::Bank& bank, const SceneStrike& strike, const std::string& name, contact::Impulse& impulse) {
  const Vec3& p = *strike.point_m;
  double least = std::numeric_limits<double>::infinity();
  Vec3 nearest{};
  for (std::size_t t = 0; t < bank.triangles.size(); ++t) {
    const auto& corner = bank.triangles[t];
    const Vec3 &a = bank.vertices_m[corner[0]], &b = bank.vertices_m[corner[1]], &c = bank.vertices_m[corner[2]];
    const Vec3 weight = find_nearest_barycentric(p, a, b, c);
    Vec3 place{};
    for (std::size_t k = 0; k < 3; ++k) place[k] = weight[0] * a[k] + weight[1] * b[k] + weight[2] * c[k];
    const Vec3 way = subtract(place, p);
    if (!(dot(way, way) < least)) continue;
    least = dot(way, way);
    nearest = place;
    impulse.triangle = static_cast<std::int32_t>(t);
    impulse.barycentric = weight;
  }
  Vec3 low = bank.vertices_m.front(), high = low;
  for (const Vec3& vertex : bank.vertices_m) {
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], vertex[k]);
      high[k] = std::max(high[k], vertex[k]);
    }
  }
  const Vec3 extent = subtract(high, low);
  if (!(least <= kFarthestShare * kFarthestShare * dot(extent, extent))) {
    throw InputError(
        fmt::format("{}: \"point_m\" is {:.4g} m away from \"{}\"; its nearest point is [{:.6g}, {:.6g}, {:.6g}] in metres of the mesh",
                    strike.place, std::sqrt(least), name, nearest[0], nearest[1], nearest[2]));
  }
}

}  // namespace

std::vector<contact::Impulse> make_impulses(const Scene& scene, const std::vector<const bank::Bank*>& banks) {
  std::vector<contact::Impulse> impulses;
  for (const SceneStrike& strike : scene.strikes) {
    const bank::Bank& bank = *banks[strike.body];
    const std::string& name = scene.bodies[strike.body].name;
    contact::Impulse impulse{.time_s = strike.time_s,
                             .body = static_cast<std::int32_t>(strike.body),
                             .barycentric = {1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0},
                             .impulse_n_s = strike.impulse_n_s,
                             .duration_s = strike.duration_s};
    if (strike.triangle) {
      impulse.triangle = *strike.triangle;
      if (static_cast<std::size_t>(impulse.triangle) >= bank.triangles.size()) {
        throw InputError(fmt::format("{}: \"triangle\" is {}, and \"{}\" has {}; the first is 0", strike.place, impulse.triangle, name,
                                     bank.triangles.size()));
      }
    } else {
      find_nearest_place(bank, strike, name, impulse);
    }
    impulses.push_back(impulse);
  }
  return impulses;
}

}  // namespace carillon::host
