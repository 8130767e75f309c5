// Method: at each point a spring and a damper that only push, f = max(0, k d + c d' g(d)), d from where the spring begins, with g rising to
// 1 within kFullDepth so that the force
//   begins without a jump; friction -mu f u / max(|u|, kCreep), so that a body on a slope creeps by less than kCreep; rolling resistance
//   -b f w / max(|w|, kSlowSpin), without which a rounded body rocks for ever.
// Source: K. Hunt, E. Crossley (1975) for a damping that grows with depth; regularised Coulomb friction as in Simbody's own contacts.
// Deviations: the points are found by the caller once a step, not at every evaluation.
#include "runtime/contact/resting.hpp"

#include <algorithm>

namespace carillon::contact {
namespace {

constexpr double kFullDepth = 4e-6;   // m; a fifth of the depth under the body's own weight
constexpr double kRollingSpin = 1.0;  // rad/s; beyond, the damping fades: who rocks on its corners turns more slowly
constexpr double kSlowSpin = 0.05;    // rad/s; below this the rolling resistance fades

}  // namespace

double calc_push(const RestingPoint& p, double pressed_m, double parting_m_s, double turning_rad_s) {
  if (pressed_m <= 0.0) return 0.0;
  const double turns = turning_rad_s / kRollingSpin, damping = p.damping_n_s_m * (0.1 + 0.9 / (1.0 + turns * turns));
  return std::max(0.0, p.stiffness_n_m * pressed_m - damping * parting_m_s * std::min(1.0, pressed_m / kFullDepth));
}

void RestingForce::calcForce(const SimTK::State& state, SimTK::Vector_<SimTK::SpatialVec>& body_forces, SimTK::Vector_<SimTK::Vec3>&,
                             SimTK::Vector&) const {
  using SimTK::dot;
  using SimTK::Vec3;
  for (const RestingPoint& p : points_) {
    const SimTK::MobilizedBody& a = matter_.getMobilizedBody(p.body_a);
    const SimTK::MobilizedBody& b = matter_.getMobilizedBody(p.body_b);
    const SimTK::Transform X_a = a.getBodyTransform(state) * p.frame_a, X_b = b.getBodyTransform(state) * p.frame_b;
    TouchPoint t = p.touch;
    place_touch(t, X_a, X_b);
    if (t.depth_m <= p.offset_m) continue;
    const Vec3 in_a = ~a.getBodyTransform(state) * t.where, in_b = ~b.getBodyTransform(state) * t.where;
    const Vec3 u = a.findStationVelocityInGround(state, in_a) - b.findStationVelocityInGround(state, in_b);
    const double un = dot(u, t.normal);
    const Vec3 roll = a.getBodyAngularVelocity(state) - b.getBodyAngularVelocity(state);
    const double push = calc_push(p, t.depth_m - p.offset_m, un, (roll - dot(roll, t.normal) * t.normal).norm());
    if (push <= 0.0) continue;
    const Vec3 slide = u - un * t.normal;
    const Vec3 force = push * t.normal - (p.friction * push / std::max(slide.norm(), kCreep)) * slide;
    a.applyForceToBodyPoint(state, in_a, force, body_forces);
    b.applyForceToBodyPoint(state, in_b, -force, body_forces);
    const Vec3 moment = (-p.rolling_arm_m * push / std::max(roll.norm(), kSlowSpin)) * roll;
    a.applyBodyTorque(state, moment, body_forces);
    b.applyBodyTorque(state, -moment, body_forces);
  }
}

SimTK::Real RestingForce::calcPotentialEnergy(const SimTK::State& state) const {
  double energy = 0.0;
  for (const RestingPoint& p : points_) {
    TouchPoint t = p.touch;
    place_touch(t, matter_.getMobilizedBody(p.body_a).getBodyTransform(state) * p.frame_a,
                matter_.getMobilizedBody(p.body_b).getBodyTransform(state) * p.frame_b);
    const double pressed = std::max(0.0, t.depth_m - p.offset_m);
    energy += 0.5 * p.stiffness_n_m * pressed * pressed;
  }
  return energy;
}

}  // namespace carillon::contact
