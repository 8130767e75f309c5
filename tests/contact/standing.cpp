// What stands goes on standing.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <variant>
#include <vector>

#include "tests/contact/checks.hpp"
#include "tests/contact/solids.hpp"

namespace carillon::contact::tests {
namespace {

BodySpec make_body(const bank::Bank& bank, Vec3 position, double restitution = 0.3) {
  BodySpec b;
  b.name = "body";
  b.bank = &bank;
  b.initial.position_m = position;
  b.restitution = restitution;
  return b;
}

struct Course {
  std::vector<stream::Motion> at_begin, at_end;  // of each body: after `settled_s`, and the last
  double last_hit_s = 0.0;
  std::int64_t steps = 0;  // after settled_s
};

Course run(const WorldSpec& spec, double settled_s, double end_s) {
  World world(spec, {.end_s = end_s});
  Course course;
  course.at_end.resize(spec.bodies.size());
  const auto take = [&](const stream::Event& e) {
    if (const auto* m = std::get_if<stream::Motion>(&e)) course.at_end[static_cast<std::size_t>(m->body)] = *m;
    if (const auto* i = std::get_if<Impulse>(&e)) course.last_hit_s = i->time_s;
  };
  const double forever = std::numeric_limits<double>::infinity();
  world.advance(settled_s, forever, take);
  course.at_begin = course.at_end;
  const std::int64_t steps = world.get_statistics().steps;
  world.advance(end_s, forever, take);
  course.steps = world.get_statistics().steps - steps;
  return course;
}

double calc_drift(const Course& course) {
  double drift = 0.0;
  for (std::size_t i = 0; i < course.at_end.size(); ++i)
    drift = std::max(drift, norm(course.at_end[i].position_m - course.at_begin[i].position_m));
  return drift;
}

TEST(Standing, AStackOfTenStandsForAnHourInSilence) {
  const bank::Bank block = make_box({0.05, 0.05, 0.05});
  WorldSpec w;
  w.ground = GroundSpec{};
  for (int i = 0; i < 10; ++i) w.bodies.push_back(make_body(block, {0, 0, 0.025 + 0.05 * i}));
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
  w.bodies = {make_body(box, {-0.04, 0, 0.02}), make_body(box, {0.04, 0.003, 0.02}), make_body(box, {0.002, 0, 0.0605}),
              make_body(box, {0.01, 0.005, 0.101})};
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
  w.bodies = {make_body(box, {0, 0, 0.06})};
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
    w.bodies = {make_body(box, {0.04 * std::sin(a), 0, 0.04 * std::cos(a)}), make_body(plane, {})};
    w.bodies[1].fixed = true;
    for (BodySpec& b : w.bodies) b.initial.rotation = {std::cos(a / 2), 0, std::sin(a / 2), 0};
    EXPECT_LT(calc_drift(run(w, 1.0, 11.0)), 1e-6) << part;
  }
}

}  // namespace
}  // namespace carillon::contact::tests
