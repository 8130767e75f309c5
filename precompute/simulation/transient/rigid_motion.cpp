#include "precompute/simulation/transient/rigid_motion.hpp"

#include <cstddef>
#include <cstdint>

#include "precompute/simulation/transient/order_free_sum.hpp"
#include "precompute/simulation/transient/vectors.hpp"

namespace carillon::transient {
namespace {

constexpr std::size_t kSums = 16;  // m, m x, m v, m x (x) v as a vector, the six components of m x x^T

/// Rigid motion of a body from its sums. A hinged body only rotates about its hinge.
RigidMotion calc_rigid_motion(const double* s, const Hinge& hinge) {
  const Vec3 middle{s[1] / s[0], s[2] / s[0], s[3] / s[0]}, v{s[4] / s[0], s[5] / s[0], s[6] / s[0]};
  const Vec3 c = hinge.is_there ? hinge.point_m : middle;
  const Vec3 turn = Vec3{s[7], s[8], s[9]} - s[0] * cross(c, v);
  Vec3 square, product;
  for (std::size_t k = 0; k < 3; ++k) {
    const std::size_t i = (k + 1) % 3, j = (k + 2) % 3;
    square[k] = s[10 + k] - s[0] * c[k] * (2.0 * middle[k] - c[k]);
    product[k] = s[13 + k] - s[0] * (c[i] * middle[j] + c[j] * middle[i] - c[i] * c[j]);
  }
  const Mat3 inertia{Vec3{square[1] + square[2], -product[2], -product[1]}, Vec3{-product[2], square[0] + square[2], -product[0]},
                     Vec3{-product[1], -product[0], square[0] + square[1]}};
  if (norm(hinge.axis) > 0.0) return {c, {}, (dot(turn, hinge.axis) / dot(hinge.axis, inertia * hinge.axis)) * hinge.axis};
  return {c, hinge.is_there ? Vec3{} : v, calc_inverse(inertia) * turn};
}

}  // namespace

Hinge make_hinge(std::span<const Vec3> places_m) {
  Vec3 way{};
  for (const Vec3& place_m : places_m)
    if (norm(place_m - places_m[0]) > norm(way)) way = place_m - places_m[0];
  return {true, places_m[0], calc_unit(way)};
}

std::vector<RigidMotion> calc_rigid_motions(const Domain& domain, const std::vector<Quad>& u, const std::vector<Quad>& v,
                                            const std::vector<char>& is_wanted, std::span<const Hinge> hinges) {
  std::vector<OrderFreeSum> sums(kSums * is_wanted.size());
  for (std::int32_t node = 0; node < domain.own_count(); ++node) {
    const std::size_t i = node, b = domain.find_body(node);
    if (is_wanted[b] == 0 || !domain.is_point(node)) continue;
    const double mass = domain.get_masses_kg()[i];
    const Vec3 x = domain.get_rest_m()[i] + to_vector(u[i]), speed = to_vector(v[i]), turn = cross(x, speed);
    OrderFreeSum* sum = &sums[kSums * b];
    sum[0].add(mass);
    for (std::size_t k = 0; k < 3; ++k) {
      sum[1 + k].add(mass * x[k]);
      sum[4 + k].add(mass * speed[k]);
      sum[7 + k].add(mass * turn[k]);
      sum[10 + k].add(mass * x[k] * x[k]);
      sum[13 + k].add(mass * x[(k + 1) % 3] * x[(k + 2) % 3]);
    }
  }
  const std::vector<double> sum = calc_sums(domain.get_comm(), sums);
  std::vector<RigidMotion> motions(is_wanted.size());
  for (std::size_t b = 0; b < motions.size(); ++b) {
    const double* s = &sum[kSums * b];
    if (is_wanted[b] != 0 && s[0] > 0.0) motions[b] = calc_rigid_motion(s, hinges[b]);
  }
  return motions;
}

}  // namespace carillon::transient
