// Hard cases of contact: thin, fast, unequal, many, wedged, and chained bodies, by their final positions.
#include <gtest/gtest.h>

#include <string>

#include "tests/hard/contact_course.hpp"
#include "tests/hard/figure.hpp"

namespace carillon::hard {
namespace {

TEST(time, contact_needle) {
  const bank::Bank needle = make_dense_box({0.001, 0.001, 0.1}, 7800.0);
  for (int turn = 0; turn < 6; ++turn) {
    WorldSpec spec;
    spec.ground = GroundSpec{};
    spec.bodies = {make_body(needle, {0, 0, 0.12})};
    spec.bodies[0].initial.rotation = {1.0, 0.3 * std::cos(turn), 0.3 * std::sin(turn), 0.2};
    spec.bodies[0].angular_velocity_rad_s = {0, 0, 50.0 * turn};
    const Course course = run(spec, 2.5, 5.0);
    const std::string part = "turn " + std::to_string(turn);
    hold("contact_needle", calc_drift(course), 1e-9, part + ", way after 2.5 s [m]");
    hold("contact_needle", std::abs(course.end[0].position_m[2] - 0.0005), 1e-5, part + ", height [m]");
  }
}

TEST(time, contact_sheet_on_edge) {
  const bank::Bank sheet = make_dense_box({0.3, 0.2, 0.0005}, 7800.0);
  for (const double lean : {0.0, 0.01, 0.3}) {
    WorldSpec spec;
    spec.ground = GroundSpec{};
    const double a = 0.5 * M_PI - lean;
    spec.bodies = {make_body(sheet, {0, 0, 0.1 * std::sin(a) + 0.00025 * std::cos(a)})};
    spec.bodies[0].initial.rotation = {std::cos(a / 2), std::sin(a / 2), 0, 0};
    const Course course = run(spec, 3.0, 5.0);
    const std::string part = "leans by " + std::to_string(lean);
    const double height = lean == 0.0 ? 0.1 : 0.00025;
    hold("contact_sheet_on_edge", std::abs(course.end[0].position_m[2] - height), 1e-5, part + ", height [m]");
    hold("contact_sheet_on_edge", calc_drift(course), 1e-9, part + ", way after 3 s [m]");
  }
}

TEST(time, contact_unequal_masses) {
  const bank::Bank light = make_dense_box({0.05, 0.05, 0.05}, 10.0), heavy = make_dense_box({0.05, 0.05, 0.05}, 10000.0);
  WorldSpec spec;
  spec.ground = GroundSpec{};
  for (int i = 0; i < 6; ++i) spec.bodies.push_back(make_body(i % 2 ? heavy : light, {0, 0, 0.025 + 0.05 * i}));
  const Course course = run(spec, 1.0, 600.0);
  hold("contact_unequal_masses", calc_drift(course), 1e-12, "way from 1 s to ten minutes [m]");
  hold("contact_unequal_masses", std::abs(course.end[5].position_m[2] - 0.275), 1e-6, "height of the uppermost [m]");
}

TEST(time, contact_fast) {
  const bank::Bank ball = make_ball(0.01, 4), plate = make_dense_box({0.3, 0.3, 0.001}, 7800.0);
  for (const double speed : {10.0, 100.0}) {
    WorldSpec spec;
    spec.gravity_m_s2 = {};
    spec.bodies = {make_body(ball, {0, 0, 0.5}, 0.5), make_body(plate, {}, 0.5)};
    spec.bodies[0].velocity_m_s = {0.02 * speed, 0, -speed};
    spec.bodies[1].fixed = true;
    const Course course = run(spec, 0.5 / speed, 0.8 / speed);
    hold("contact_fast", std::abs(course.end[0].velocity_m_s[2] / (0.5 * speed) - 1.0), 1e-3,
         std::to_string(speed) + " m/s, speed after, relative");
  }
}

TEST(time, contact_small_gaps) {
  const bank::Bank box = make_box({0.1, 0.08, 0.05});
  for (const double gap : {1e-5, 1e-6, 1e-8}) {
    WorldSpec spec;
    spec.ground = GroundSpec{};
    for (int i = 0; i < 8; ++i) spec.bodies.push_back(make_body(box, {0, 0, 0.025 + (0.05 + gap) * i + gap}));
    const Course course = run(spec, 1.0, 10.0);
    const std::string part = "gaps of " + std::to_string(1e6 * gap) + " um";
    hold("contact_small_gaps", std::abs(course.end[7].position_m[2] - 0.375), 1e-5, part + ", height of the uppermost [m]");
    hold("contact_small_gaps", calc_drift(course), 1e-9, part + ", way after 1 s [m]");
  }
}

TEST(time, contact_wedged) {
  // Two plates that make a funnel; a ball and a box fall into it, and stay.
  const bank::Bank plate = make_box({0.02, 0.4, 0.4}), ball = make_ball(0.03, 4), box = make_box({0.05, 0.06, 0.06});
  for (const bool is_ball : {true, false}) {
    WorldSpec spec;
    const double a = 0.25;  // of either plate from upright: tan a < friction
    spec.bodies = {make_body(is_ball ? ball : box, {0, 0, 0.12}), make_body(plate, {-0.07, 0, 0}), make_body(plate, {0.07, 0, 0})};
    for (std::size_t i = 1; i < 3; ++i) {
      const double turn = i == 1 ? -a : a;
      spec.bodies[i].fixed = true;
      spec.bodies[i].initial.rotation = {std::cos(turn / 2), 0, std::sin(turn / 2), 0};
    }
    const Course course = run(spec, 3.0, 13.0);
    const std::string part = is_ball ? "ball" : "box";
    hold("contact_wedged", calc_drift(course), 1e-6, part + ", way in ten seconds [m]");
    hold("contact_wedged", std::abs(course.end[0].position_m[0]), 0.01, part + ", off the middle [m]");
  }
}

TEST(time, contact_crowd) {
  // 500 boxes fall into a box without a lid.
  const bank::Bank cube = make_dense_box({0.02, 0.018, 0.016}, 600.0), wall = make_box({0.02, 0.4, 0.6});
  WorldSpec spec;
  spec.ground = GroundSpec{};
  for (int i = 0; i < 4; ++i) {
    const double a = i * M_PI / 2;
    BodySpec body = make_body(wall, {0.16 * std::cos(a), 0.16 * std::sin(a), 0.3});
    body.fixed = true;
    body.initial.rotation = {std::cos(a / 2), 0, 0, std::sin(a / 2)};
    spec.bodies.push_back(body);
  }
  for (int i = 0; i < 500; ++i) {
    BodySpec body = make_body(cube, {-0.112 + 0.032 * (i % 8), -0.112 + 0.032 * (i / 8 % 8), 0.03 + 0.034 * (i / 64)});
    body.initial.rotation = {1.0, 0.2 * std::sin(i), 0.3 * std::cos(3 * i), 0.1};
    spec.bodies.push_back(body);
  }
  const Course course = run(spec, 0.07, 0.2);
  int outside = 0;
  double depth = 0.0;
  for (std::size_t i = 4; i < spec.bodies.size(); ++i) {
    const Vec3& x = course.end[i].position_m;
    outside += std::abs(x[0]) > 0.15 || std::abs(x[1]) > 0.15 || x[2] < 0.0 ? 1 : 0;
    depth = std::max(depth, calc_depth(cube, course.end[i]));
  }
  hold("contact_crowd", outside, 0.0, "bodies outside");
  hold("contact_crowd", depth, 1e-4, "deepest in the ground [m]");
  hold("contact_crowd", calc_rise(course), 1e-5, "energy gained as a height [m]");
}

TEST(time, contact_rings) {
  // A ring hangs in another one, and swings.
  const bank::Bank ring = make_bank(geometry::tests::make_ring(0.05, 0.005, 64, 16), 7800.0);
  WorldSpec spec;
  spec.bodies = {make_body(ring, {}), make_body(ring, {0, 0, -0.085})};
  spec.bodies[0].fixed = true;
  spec.bodies[0].initial.rotation = {std::sqrt(0.5), std::sqrt(0.5), 0, 0};
  spec.bodies[1].initial.rotation = {0.5, 0.5, 0.5, 0.5};
  spec.bodies[1].angular_velocity_rad_s = {1.0, 2.0, 0.5};
  const Course course = run(spec, 1.0, 2.0);
  // Farther than a ring's hole and its wire allow they have come apart; nearer than that one has passed into the other.
  hold("contact_rings", norm(course.end[1].position_m), 2 * (0.05 - 0.005) + 1e-3, "distance of the centres [m]");
}

}  // namespace
}  // namespace carillon::hard
