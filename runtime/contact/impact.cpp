// Method: impulses at n points by projected relaxation: first Jacobi sweeps damped by 1/n, which share the load evenly where the points are
//   redundant (a box that lands flat) and keep every symmetry, then Gauss-Seidel sweeps to convergence. Newton's restitution, Coulomb's
//   cone.
// Source: B. Mirtich, "Impulse-based dynamic simulation of rigid body systems" (1996); J. Moreau, "Some numerical methods in multibody
// dynamics"
//   (1999). Contact time: K. L. Johnson, "Contact mechanics" (1985), eq. 11.24.
// Deviations: Newton's restitution with friction can gain energy (Kane 1984); then all impulses are scaled back to where it is not so.
#include "runtime/contact/impact.hpp"

#include <algorithm>
#include <cmath>

namespace carillon::contact {
namespace {

using SimTK::cross;
using SimTK::dot;
using SimTK::Mat33;
using SimTK::Vec3;

/// Velocity gained per impulse at `where` of one body, as a matrix: 1/m I - [r] I^-1 [r].
Mat33 calc_mobility(const Mobile& m, const Vec3& where) {
  const Mat33 r = SimTK::crossMat(where - m.centre);
  return Mat33(m.inverse_mass) - r * m.inverse_inertia * r;
}

void apply(Mobile& m, const Vec3& where, const Vec3& impulse) {
  m.velocity += m.inverse_mass * impulse;
  m.spin += m.inverse_inertia * cross(where - m.centre, impulse);
}

void apply(std::vector<Mobile>& bodies, const ImpactPoint& p, const Vec3& impulse) {
  if (p.a >= 0) apply(bodies[p.a], p.where, impulse);
  if (p.b >= 0) apply(bodies[p.b], p.where, -impulse);
}

struct Row {
  double k_normal = 0.0;   // normal velocity per normal impulse
  double k_tangent = 0.0;  // largest tangential velocity per tangential impulse
  double wanted = 0.0;     // normal velocity afterwards, at least
};

/// The impulse that this point ought to have, seeing the velocities as they are now; `step` relaxes.
Vec3 calc_update(const std::vector<Mobile>& bodies, const ImpactPoint& p, const Row& row, double step) {
  const Vec3 u = calc_relative_velocity(bodies, p);
  const double un = dot(u, p.normal);
  const double old_n = dot(p.impulse, p.normal);
  const double new_n = std::max(0.0, old_n + step * (row.wanted - un) / row.k_normal);
  Vec3 tangent = p.impulse - old_n * p.normal - (step / row.k_tangent) * (u - un * p.normal);
  const double size = tangent.norm(), limit = p.friction * new_n;
  if (size > limit) tangent *= size > 0.0 ? limit / size : 0.0;
  return new_n * p.normal + tangent;
}

/// The kinetic energy after a share s of all impulses changes by linear s + quadratic s^2; returns the largest s <= 1 that gains nothing.
double calc_safe_share(const std::vector<Mobile>& before, const std::vector<ImpactPoint>& points, const std::vector<Mobile>& after) {
  double linear = 0.0, quadratic = 0.0;
  for (const ImpactPoint& p : points) {
    const Vec3 u0 = calc_relative_velocity(before, p), u1 = calc_relative_velocity(after, p);
    linear += dot(p.impulse, u0);
    quadratic += 0.5 * dot(p.impulse, u1 - u0);
  }
  if (linear + quadratic <= 0.0 || quadratic <= 0.0) return 1.0;
  return std::clamp(-linear / quadratic, 0.0, 1.0);
}

}  // namespace

Vec3 calc_relative_velocity(const std::vector<Mobile>& bodies, const ImpactPoint& p) {
  Vec3 u(0);
  if (p.a >= 0) u += bodies[p.a].velocity + cross(bodies[p.a].spin, p.where - bodies[p.a].centre);
  if (p.b >= 0) u -= bodies[p.b].velocity + cross(bodies[p.b].spin, p.where - bodies[p.b].centre);
  return u;
}

double calc_inverse_effective_mass(const std::vector<Mobile>& bodies, int a, int b, const Vec3& where, const Vec3& direction) {
  double inverse = 0.0;
  for (const int i : {a, b}) {
    if (i >= 0) inverse += dot(direction, calc_mobility(bodies[i], where) * direction);
  }
  return inverse;
}

void solve_impact(std::vector<Mobile>& bodies, std::vector<ImpactPoint>& points, double threshold_m_s) {
  const std::vector<Mobile> before = bodies;
  std::vector<Row> rows(points.size());
  double scale = threshold_m_s;
  for (std::size_t i = 0; i < points.size(); ++i) {
    ImpactPoint& p = points[i];
    Mat33 k(0);
    for (const int body : {p.a, p.b}) {
      if (body >= 0) k += calc_mobility(bodies[body], p.where);
    }
    const Mat33 flat = Mat33(1) - p.normal * ~p.normal;
    const Mat33 tangential = flat * k * flat;
    rows[i].k_normal = dot(p.normal, k * p.normal);
    rows[i].k_tangent = std::max(tangential.norm(), 1e-9 * rows[i].k_normal);  // Frobenius: not below the largest eigenvalue
    p.approach_m_s = -dot(calc_relative_velocity(bodies, p), p.normal);
    rows[i].wanted = p.approach_m_s > threshold_m_s ? p.restitution * p.approach_m_s : 0.0;
    p.impulse = Vec3(0);
    scale = std::max(scale, std::abs(p.approach_m_s));
  }
  const int count = static_cast<int>(points.size());
  std::vector<Vec3> updates(points.size());
  for (int sweep = 0; sweep < std::min(20 * count, 400); ++sweep) {
    for (int i = 0; i < count; ++i) updates[i] = calc_update(bodies, points[i], rows[i], 1.0 / count);
    for (int i = 0; i < count; ++i) {
      apply(bodies, points[i], updates[i] - points[i].impulse);
      points[i].impulse = updates[i];
    }
  }
  for (int sweep = 0; sweep < 1000; ++sweep) {
    double largest = 0.0;
    for (int k = 0; k < count; ++k) {
      const int i = sweep % 2 == 0 ? k : count - 1 - k;  // to and fro, so that no end is favoured
      const Vec3 update = calc_update(bodies, points[i], rows[i], 1.0);
      const Vec3 change = update - points[i].impulse;
      largest = std::max(largest, change.norm() * rows[i].k_normal);
      apply(bodies, points[i], change);
      points[i].impulse = update;
    }
    if (largest < 1e-9 * scale) break;
  }
  const double share = calc_safe_share(before, points, bodies);
  if (share < 1.0) {
    for (ImpactPoint& p : points) {
      apply(bodies, p, (share - 1.0) * p.impulse);
      p.impulse *= share;
    }
  }
}

double calc_hertz_duration(const Elastic& a, const Elastic& b, double mass_kg, double speed_m_s, double largest_radius_m) {
  const double compliance =
      (1 - a.poisson_ratio * a.poisson_ratio) / a.young_modulus_pa + (1 - b.poisson_ratio * b.poisson_ratio) / b.young_modulus_pa;
  const double curvature = std::max(a.curvature_per_m + b.curvature_per_m, 0.0);
  const double radius = 1.0 / std::clamp(curvature, 1.0 / std::max(largest_radius_m, 0.5e-3), 1.0 / 0.5e-3);
  const double speed = std::max(speed_m_s, 1e-3);
  const double duration = 2.87 * std::pow(mass_kg * mass_kg * compliance * compliance / (radius * speed), 0.2);
  return std::clamp(duration, 5e-6, 20e-3);
}

}  // namespace carillon::contact
