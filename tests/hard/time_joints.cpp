// Hard cases of joints and cords: unequal masses, long chains, hinged bodies that rest, cords that swing for long or share a load.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <variant>
#include <vector>

#include "tests/hard/contact_course.hpp"
#include "tests/hard/figure.hpp"

namespace carillon::hard {
namespace {

using joints::Kind;

bank::Bank weigh(bank::Bank bank, double mass_kg) {
  const double part = mass_kg / bank.rigid.mass_kg;
  bank.rigid.mass_kg *= part;
  for (double& x : bank.rigid.inertia_kg_m2) x *= part;
  return bank;
}

/// Links on ball joints from the origin along x, and a body at their end.
WorldSpec make_chain(const bank::Bank& link, double length_m, int count, const bank::Bank* weight, double radius_m) {
  WorldSpec spec;
  for (int i = 0; i < count; ++i) {
    spec.bodies.push_back(make_body(link, {length_m * (i + 0.5), 0, 0}, 0.5));
    spec.joints.push_back({.kind = Kind::kBall, .body = i, .to = i - 1, .at_m = {length_m * i, 0, 0}});
  }
  if (weight != nullptr) {
    spec.bodies.push_back(make_body(*weight, {length_m * count + radius_m, 0, 0}, 0.5));
    spec.joints.push_back({.kind = Kind::kBall, .body = count, .to = count - 1, .at_m = {length_m * count, 0, 0}});
  }
  return spec;
}

TEST(time, joints_unequal_masses) {
  const bank::Bank link = weigh(make_box({0.03, 0.006, 0.006}), 1e-3), ball = weigh(make_ball(0.02, 3), 1.0);
  for (const bool is_taut : {true, false}) {
    WorldSpec spec = make_chain(link, 0.03, 8, &ball, 0.02);
    // Taut it hangs and swings; let go out of the horizontal it folds, and links strike each other and the ball.
    if (is_taut) spec.gravity_m_s2 = {9.81 * std::cos(0.8), 0, -9.81 * std::sin(0.8)};
    const Course course = run(spec, 1.0, 2.0);
    const auto& energy = course.energy;
    const std::string part = is_taut ? "taut" : "folding";
    hold("joints_unequal_masses", energy.error_j / energy.kinetic_j, is_taut ? 1e-8 : 2e-3, part + ", energy unbooked, as a share");
    hold("joints_unequal_masses", std::max(0.0, norm(course.end.back().position_m) - 0.26), 1e-9, part + ", beyond its chain [m]");
  }
}

TEST(time, joints_whip) {
  // A hundred links let go out of the horizontal: the last ones are thrown about at many times the speed of the fall.
  const bank::Bank link = make_box({0.01, 0.003, 0.003});
  const WorldSpec spec = make_chain(link, 0.01, 100, nullptr, 0.0);
  const Course course = run(spec, 0.2, 0.5);
  const auto& energy = course.energy;
  hold("joints_whip", energy.error_j / energy.kinetic_j, 1e-4, "energy unbooked, as a share");
  hold("joints_whip", std::max(0.0, norm(course.end.back().position_m) - 0.995), 1e-9, "last link beyond its chain [m]");
}

TEST(time, joints_both_rest) {
  // Two boxes on a hinge lie on the ground: their joint and six points that carry are more than the motion determines.
  const bank::Bank box = make_box({0.1, 0.06, 0.03});
  WorldSpec spec;
  spec.ground = GroundSpec{};
  spec.bodies = {make_body(box, {-0.051, 0, 0.016}, 0.5), make_body(box, {0.051, 0, 0.016}, 0.5)};
  spec.joints = {{.kind = Kind::kHinge, .body = 1, .to = 0, .at_m = {0, 0, 0.016}, .axis = {0, 1, 0}}};
  const Course course = run(spec, 1.0, 600.0, {}, true);
  hold("joints_both_rest", calc_drift(course), 1e-9, "way from 1 s to ten minutes [m]");
  hold("joints_both_rest", std::abs(course.end[0].position_m[2] - 0.015) + std::abs(course.end[1].position_m[2] - 0.015), 1e-5,
       "off the ground [m]");
}

TEST(time, cords_swing) {
  const bank::Bank ball = make_ball(0.02, 3);
  WorldSpec spec;
  spec.bodies = {make_body(ball, {0.3, 0, -0.4}, 0.5)};
  spec.bodies[0].velocity_m_s = {0, 0.8, 0};  // round about, not in a plane
  spec.cords = {{.body = 0, .to = -1, .from_m = {0.3, 0, -0.4}, .to_m = {0, 0, 0}}};
  const Course course = run(spec, 1.0, 120.0);
  const auto& energy = course.energy;
  hold("cords_swing", energy.error_j / energy.kinetic_j, 1e-5, "energy unbooked in two minutes, as a share");
  hold("cords_swing", std::abs(energy.lost_j) / energy.kinetic_j, 1e-3, "energy lost, as a share");
  hold("cords_swing", std::abs(norm(course.end[0].position_m) - 0.5), 5e-6, "off its length [m]");
}

TEST(time, cords_share_a_load) {
  // Eight cords where three would do, of a plate that is dropped into them.
  const bank::Bank plate = make_box({0.3, 0.3, 0.02});
  WorldSpec spec;
  spec.bodies = {make_body(plate, {0, 0, 0.004}, 0.5)};
  for (int i = 0; i < 8; ++i) {
    const double a = i * M_PI / 4, x = 0.14 * std::cos(a), y = 0.14 * std::sin(a);
    spec.cords.push_back({.body = 0, .to = -1, .from_m = {x, y, 0.004}, .to_m = {x, y, 0.2}, .length_m = 0.2});
  }
  const Course course = run(spec, 1.0, 600.0);
  hold("cords_share_a_load", calc_drift(course), 1e-9, "way from 1 s to ten minutes [m]");
  hold("cords_share_a_load", std::abs(course.end[0].position_m[2]), 5e-6, "off its height [m]");
}

}  // namespace
}  // namespace carillon::hard
