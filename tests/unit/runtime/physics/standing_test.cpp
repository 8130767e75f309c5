// Standing bodies remain standing.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <variant>
#include <vector>

#include "tests/unit/runtime/physics/bodies.hpp"

namespace carillon::physics::tests {
namespace {

TEST(Standing, SilentStackOfTen) {
  const bank::Bank block = make_box({0.05, 0.05, 0.05});
  WorldSpec w;
  w.ground = GroundSpec{};
  for (int i = 0; i < 10; ++i) w.bodies.push_back(make_body("body", block, {0, 0, 0.025 + 0.05 * i}));
  const Course course = run(w, 1.0, 3600.0);
  EXPECT_EQ(calc_drift(course), 0.0);
  EXPECT_LT(course.last_hit_s, 0.01);
  EXPECT_EQ(course.steps, 0) << "it does not sleep";
  for (int i = 0; i < 10; ++i) EXPECT_NEAR(course.at_end[i].position_m[2], 0.025 + 0.05 * i, 1e-6) << i;
}

TEST(Standing, NoCreepOfStackedBoxes) {
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

TEST(Standing, RestNextToFastBody) {
  // Boxes stand on a plank, each in touch with it alone, while another one slides along the plank without friction.
  const bank::Bank box = make_box({0.06, 0.05, 0.04}), plank = make_box({2.0, 0.4, 0.02});
  WorldSpec w;
  w.ground = GroundSpec{};
  w.bodies = {make_body("plank", plank, {0, 0, 0.01}), make_body("fast", box, {-0.9, 0.1, 0.04})};
  for (int i = 0; i < 6; ++i) w.bodies.push_back(make_body("stands", box, {-0.5 + 0.2 * i, -0.1, 0.04}));
  w.bodies[1].velocity_m_s = {5.0, 0, 0};
  w.bodies[1].friction = 0.0;
  World world(w, {.end_s = 0.3, .lasting_contacts = false});
  std::vector<events::BodyMotion> begun(w.bodies.size()), last(w.bodies.size());
  int hits = 0;
  world.advance(0.3, std::numeric_limits<double>::infinity(), [&](const events::Event& e) {
    if (const auto* i = std::get_if<Impulse>(&e)) hits += i->body >= 2 ? 1 : 0;
    if (const auto* m = std::get_if<events::BodyMotion>(&e)) {
      last[m->body] = *m;
      if (m->time_s == 0.0) begun[m->body] = *m;
    }
  });
  EXPECT_NEAR(last[1].position_m[0] - begun[1].position_m[0], 1.5, 1e-6) << "nothing brakes it";
  EXPECT_EQ(hits, 0);
  for (std::size_t i = 2; i < w.bodies.size(); ++i) EXPECT_LT(norm(last[i].position_m - begun[i].position_m), 1e-6) << i;
}

TEST(Standing, FinalMotionRecordOfSleepingBody) {
  const bank::Bank box = make_box({0.06, 0.05, 0.04});
  WorldSpec w;
  w.ground = GroundSpec{};
  w.bodies = {make_body("body", box, {0, 0, 0.06})};
  w.bodies[0].initial.rotation = {1.0, 0.3, 0.2, 0.1};
  World world(w, {.end_s = 10.0});
  events::BodyMotion last;
  world.advance(5.0, std::numeric_limits<double>::infinity(), [&](const events::Event& e) {
    if (const auto* m = std::get_if<events::BodyMotion>(&e)) last = *m;
  });
  EXPECT_LT(last.time_s, 4.0);
  EXPECT_EQ(norm(last.velocity_m_s), 0.0);
}

TEST(Standing, NoCreepOnSlope) {
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

/// A card house of three storeys, of cards of 88 x 63 x 0.3 mm that lean by 20 degrees.
WorldSpec build_card_house(const bank::Bank& card, double friction) {
  const double thickness = 0.0003, length = 0.088, lean = 20.0 * M_PI / 180.0, c = std::cos(lean), s = std::sin(lean);
  const double half = 0.5 * (length * c + thickness * s), side = 0.5 * (length * s + thickness * c), pitch = 4.0 * side;
  WorldSpec w;
  w.ground = GroundSpec{.friction = friction};
  const auto add = [&](double x, double z, double angle) {
    w.bodies.push_back(make_body("card", card, {x, 0, z}, 0.0));
    w.bodies.back().friction = friction;
    w.bodies.back().initial.rotation = {std::cos(angle / 2), 0, std::sin(angle / 2), 0};
  };
  double below = 0.0;
  for (int frames = 3; frames > 0; --frames) {
    const double first = -0.5 * (frames - 1) * pitch;
    for (int i = 0; i < frames; ++i)
      for (const int way : {-1, 1}) add(first + pitch * i + way * side, below + half, -way * lean);
    below += 2.0 * half;
    for (int i = 0; i + 1 < frames; ++i) add(first + pitch * (i + 0.5), below + 0.5 * thickness, 0.5 * M_PI);
    below += thickness;
  }
  return w;
}

TEST(Standing, CardHouse) {
  bank::Bank card = make_box({0.0003, 0.063, 0.088});
  card.material = {3e9, 0.3, 900.0, 1e-6, 50.0};
  set_rigid_of_solid(card);
  for (const double friction : {0.5, 0.6}) {
    const WorldSpec w = build_card_house(card, friction);
    const Course course = run(w, 2.0, 12.0);
    EXPECT_LT(calc_drift(course), 1e-6) << friction;
    EXPECT_EQ(course.steps, 0) << "it does not sleep, " << friction;
    // Its edges find each other by less than a card is thick.
    for (std::size_t i = 0; i < w.bodies.size(); ++i)
      EXPECT_LT(norm(course.at_end[i].position_m - w.bodies[i].initial.position_m), 3e-4) << friction << ", card " << i;
  }
  // A pair without load takes tan(20 degrees)/2 = 0.18.
  const WorldSpec w = build_card_house(card, 0.1);
  const Course course = run(w, 2.0, 2.1);
  for (const events::BodyMotion& m : course.at_end) EXPECT_LT(m.position_m[2], 0.05);
}

}  // namespace
}  // namespace carillon::physics::tests
