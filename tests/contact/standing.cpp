// What stands goes on standing.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "tests/contact/bodies.hpp"

namespace carillon::contact::tests {
namespace {

TEST(Standing, AStackOfTenStandsForAnHourInSilence) {
  const bank::Bank block = make_box({0.05, 0.05, 0.05});
  WorldSpec w;
  w.ground = GroundSpec{};
  for (int i = 0; i < 10; ++i) w.bodies.push_back(make_body("body", block, {0, 0, 0.025 + 0.05 * i}));
  const Course course = run(w, 1.0, 3600.0);
  EXPECT_EQ(calc_drift(course), 0.0);
  EXPECT_LT(course.last_hit_s, 0.01);
  EXPECT_EQ(course.steps, 0) << "it does not sleep";
  for (int i = 0; i < 10; ++i) EXPECT_NEAR(course.at_end[static_cast<std::size_t>(i)].position_m[2], 0.025 + 0.05 * i, 1e-6) << i;
}

TEST(Standing, ABoxOnOthersDoesNotCreep) {
  // A bridge: two below, one across, turned, and one leaning on nothing on top; dropped by half a millimetre.
  const bank::Bank box = make_box({0.06, 0.05, 0.04});
  WorldSpec w;
  w.ground = GroundSpec{};
  w.bodies = {make_body("body", box, {-0.04, 0, 0.02}), make_body("body", box, {0.04, 0.003, 0.02}),
              make_body("body", box, {0.002, 0, 0.0605}), make_body("body", box, {0.01, 0.005, 0.101})};
  w.bodies[2].initial.rotation = {std::cos(0.1), 0, 0, std::sin(0.1)};
  w.bodies[3].initial.rotation = {std::cos(0.4), 0, 0, std::sin(0.4)};
  const Course course = run(w, 2.0, 12.0);
  EXPECT_LT(calc_drift(course), 1e-6);
  EXPECT_LT(course.last_hit_s, 1.0);
}

TEST(Standing, WhatFallsAsleepSaysSoByALastMotionAtRest) {
  const bank::Bank box = make_box({0.06, 0.05, 0.04});
  WorldSpec w;
  w.ground = GroundSpec{};
  w.bodies = {make_body("body", box, {0, 0, 0.06})};
  w.bodies[0].initial.rotation = {1.0, 0.3, 0.2, 0.1};
  World world(w, {.end_s = 10.0});
  stream::Motion last;
  world.advance(5.0, std::numeric_limits<double>::infinity(), [&](const stream::Event& e) {
    if (const auto* m = std::get_if<stream::Motion>(&e)) last = *m;
  });
  EXPECT_LT(last.time_s, 4.0);
  EXPECT_EQ(norm(last.velocity_m_s), 0.0);
}

TEST(Standing, OnASlopeThatFrictionHoldsNothingCreeps) {
  const bank::Bank box = make_box({0.06, 0.05, 0.04}), plane = make_box({1.0, 0.4, 0.04});
  for (const double part : {0.5, 0.9, 0.98}) {
    const double a = std::atan(0.4 * part);  // of the angle at which it slides
    WorldSpec w;
    w.bodies = {make_body("body", box, {0.04 * std::sin(a), 0, 0.04 * std::cos(a)}), make_body("body", plane, {})};
    w.bodies[1].fixed = true;
    for (BodySpec& b : w.bodies) b.initial.rotation = {std::cos(a / 2), 0, std::sin(a / 2), 0};
    EXPECT_LT(calc_drift(run(w, 1.0, 11.0)), 1e-6) << part;
  }
}

}  // namespace
}  // namespace carillon::contact::tests
