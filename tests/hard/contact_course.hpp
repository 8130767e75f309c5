// Worlds of the hard cases of contact: bodies, motion, and final checks.
#pragma once

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <variant>
#include <vector>

#include "runtime/physics/world.hpp"
#include "tests/unit/runtime/physics/bodies.hpp"
#include "tests/unit/runtime/physics/geometry/solids.hpp"

namespace carillon::hard {

using carillon::norm;
using physics::BodySpec;
using physics::GroundSpec;
using physics::World;
using physics::WorldSpec;
using physics::tests::make_ball;
using physics::tests::make_box;
using carillon::operator+;
using carillon::operator-;
using carillon::operator*;

inline constexpr double kGravity = 9.81;

inline bank::Bank make_bank(const geometry::tests::Solid& solid, double density) {
  return physics::tests::make_bank(solid, {70e9, 0.3, density, 1e-6, 10.0});
}

inline bank::Bank make_dense_box(Vec3 size, double density) {
  bank::Bank box = make_box(size);
  box.material.density_kg_m3 = density;
  physics::tests::set_rigid_of_solid(box);
  return box;
}

/// A ball of 20 n^2 facets; mass and inertia are those of the true ball.
inline bank::Bank make_round(double radius_m, int n) {
  bank::Bank ball = make_bank(geometry::tests::make_ball(radius_m, n), 2700.0);
  ball.rigid = make_ball(radius_m, 1).rigid;
  return ball;
}

inline BodySpec make_body(const bank::Bank& bank, Vec3 position, double restitution = 0.3) {
  return physics::tests::make_body("body", bank, position, restitution);
}

/// Results of a world at its end.
struct Course {
  std::vector<events::BodyMotion> middle, end;
  physics::EnergyAudit energy;
  int hits = 0;
};

/// Calls `look` (may be empty) with every motion.
inline Course run(const WorldSpec& spec, double middle_s, double end_s, const std::function<void(const events::BodyMotion&)>& look = {},
                  bool lasting_contacts = false) {
  World world(spec, {.end_s = end_s, .lasting_contacts = lasting_contacts, .audits_energy = true});
  Course course;
  course.end.resize(spec.bodies.size());
  const auto take = [&](const events::Event& e) {
    if (std::holds_alternative<events::Impulse>(e)) ++course.hits;
    const auto* m = std::get_if<events::BodyMotion>(&e);
    if (m == nullptr) return;
    course.end[m->body] = *m;
    if (look) look(*m);
  };
  const double forever = std::numeric_limits<double>::infinity();
  world.advance(middle_s, forever, take);
  course.middle = course.end;
  world.advance(end_s, forever, take);
  course.energy = world.get_statistics().energy;
  return course;
}

inline double calc_drift(const Course& course) {
  double drift = 0.0;
  for (std::size_t i = 0; i < course.end.size(); ++i) drift = std::max(drift, norm(course.end[i].position_m - course.middle[i].position_m));
  return drift;
}

/// The most that the energy rose, in steps or by a hit, as a height of all that moves [m].
inline double calc_rise(const Course& course) { return std::max(course.energy.rise_j, course.energy.hit_rise_j) / course.energy.weight_n; }

/// How far the lowest corner of a body is below z = 0 [m].
inline double calc_depth(const bank::Bank& bank, const events::BodyMotion& motion) {
  double depth = -1.0;
  for (const auto& x : bank.vertices_m)
    depth = std::max(depth, -(motion.position_m[2] + physics::tests::rotate(motion.rotation, x - bank.rigid.centre_m)[2]));
  return depth;
}

}  // namespace carillon::hard
