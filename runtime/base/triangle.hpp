// Surface triangles.
#pragma once

#include <array>
#include <cstdint>

#include "runtime/base/vector.hpp"

namespace carillon {

/// Vertex indices.
using Triangle = std::array<std::int32_t, 3>;

/// Barycentric coordinates of the point of a triangle (a, b, c) closest to p, from the products d1 = ab . ap, d2 = ac . ap, d3 = ab . bp,
/// d4 = ac . bp, d5 = ab . cp, d6 = ac . cp. Undefined for degenerate triangles. Ericson, Real-Time Collision Detection (2005), 5.1.5.
inline Vec3 weigh_corners(double d1, double d2, double d3, double d4, double d5, double d6) noexcept {
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
  const double sum = over_bc + over_ac + over_ab;
  return {over_bc / sum, over_ac / sum, over_ab / sum};
}

/// The same from the vertices.
inline Vec3 weigh_corners(const Vec3& p, const Vec3& a, const Vec3& b, const Vec3& c) noexcept {
  const Vec3 ab = b - a, ac = c - a, ap = p - a, bp = p - b, cp = p - c;
  return weigh_corners(dot(ab, ap), dot(ac, ap), dot(ab, bp), dot(ac, bp), dot(ab, cp), dot(ac, cp));
}

}  // namespace carillon
