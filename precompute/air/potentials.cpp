// Method:     Gauss's theorem in the plane turns integrals over the triangle into integrals over its edges: f = integral of dl / R along
//   each edge and beta, the edge's part of the solid angle.
// Source:     Wilton 1984 (constant and linear densities), Graglia 1993 (their gradients); docs/equations.md E10.
#include "precompute/air/potentials.hpp"

#include <cmath>

namespace carillon::air {
namespace {

/// Integral of dl / R from s0 to s1; r0, r1: distances of the ends; `near`: squared distance of the line. Avoids cancellation on both sides
/// and, by (r0 + s0) (r0 - s0) = near, next to the edge.
double integrate_edge(double s0, double s1, double r0, double r1, double near) {
  if (s0 < 0.0 && s1 > 0.0) return std::log((r1 + s1) * (r0 - s0) / near);
  if (s0 + s1 >= 0.0) return std::log((r1 + s1) / (r0 + s0));
  return std::log((r0 - s0) / (r1 - s1));
}

}  // namespace

Potentials calc_potentials(const std::array<Vec3, 3>& corners_m, const Vec3& normal, const std::array<Vec3, 3>& curl, const Vec3& x_m) {
  const double d = dot(x_m - corners_m[0], normal), height = std::abs(d);
  const Vec3 foot = x_m - d * normal;
  double area_integral = 0.0, angle = 0.0;  // integral of 1 / R, solid angle without sign
  Vec3 first{}, lines{};                    // integral of (y - foot) / R; sum of outward normals times f
  Mat3 tensor{};                            // sum of u (x) integral of (y - foot) / R dl
  for (std::size_t e = 0; e < 3; ++e) {
    const Vec3 &a = corners_m[e], &b = corners_m[(e + 1) % 3];
    const Vec3 along = normalise(b - a), out = cross(along, normal);
    const double t = dot(a - foot, out), s0 = dot(a - foot, along), s1 = dot(b - foot, along);
    const double r0 = norm(x_m - a), r1 = norm(x_m - b), near = t * t + d * d;
    const double f = integrate_edge(s0, s1, r0, r1, near);
    if (near > 0.0) angle += std::atan2(t * s1, near + height * r1) - std::atan2(t * s0, near + height * r0);
    area_integral += t * f;
    first = first + 0.5 * (near * f + s1 * r1 - s0 * r0) * out;
    lines = lines + f * out;
    const Vec3 moment = (t * f) * out + (r1 - r0) * along;
    for (std::size_t i = 0; i < 3; ++i) tensor[i] = tensor[i] + out[i] * moment;
  }
  area_integral -= height * angle;
  const double signed_angle = d > 0.0 ? angle : d < 0.0 ? -angle : 0.0;
  const Vec3 constant_gradient = -1.0 * lines - signed_angle * normal;
  Potentials result;
  result.constant = area_integral;
  for (std::size_t c = 0; c < 3; ++c) {
    const Vec3 slope = cross(normal, curl[c]);  // gradient of the hat function in the plane
    const double at_foot = 1.0 + dot(slope, foot - corners_m[c]);
    result.single[c] = at_foot * area_integral + dot(slope, first);
    result.double_layer[c] = at_foot * signed_angle - d * dot(slope, lines);
    // Gradient of the integral of lambda / R: at_foot times that of 1 / R, and slope . integral of (y - foot) grad(1 / R).
    const Vec3 in_plane = area_integral * slope - Vec3{dot({tensor[0][0], tensor[1][0], tensor[2][0]}, slope),
                                                       dot({tensor[0][1], tensor[1][1], tensor[2][1]}, slope),
                                                       dot({tensor[0][2], tensor[1][2], tensor[2][2]}, slope)};
    result.gradient[c] = at_foot * constant_gradient + in_plane + (d * dot(slope, lines)) * normal;
  }
  return result;
}

}  // namespace carillon::air
