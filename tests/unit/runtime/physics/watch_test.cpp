// The audit of contacts: depths that are known, and hits against events.
#include <gtest/gtest.h>

#include <limits>
#include <variant>

#include "tests/unit/runtime/physics/bodies.hpp"

namespace carillon::physics::tests {
namespace {

constexpr double kForever = std::numeric_limits<double>::infinity();

TEST(ContactAudit, DepthAtStart) {
  const bank::Bank box = make_box({0.06, 0.05, 0.04}), ball = make_ball(0.03, 3);
  constexpr double kDepth = 1.5e-4;
  for (const bool is_ball : {false, true}) {
    WorldSpec spec;
    spec.ground = GroundSpec{};
    spec.bodies = {make_body("lower", box, {0, 0, 0.02}),
                   make_body("upper", is_ball ? ball : box, {0, 0, (is_ball ? 0.07 : 0.06) - kDepth})};
    World world(spec, {.end_s = 1.0, .audits_energy = true});
    world.advance(0.0, kForever, [](const events::Event&) {});
    const Depth start = world.get_statistics().contacts.deepest;
    EXPECT_NEAR(start.depth_m, kDepth, 1e-9);
    EXPECT_DOUBLE_EQ(start.unexplained_m, start.depth_m);
    EXPECT_EQ(start.body, 0);
    EXPECT_EQ(start.other, 1);
    EXPECT_EQ(start.time_s, 0.0);
    EXPECT_NEAR(start.calc_excess(), 1.5, 1e-4);
    world.advance(1.0, kForever, [](const events::Event&) {});
    const Statistics end = world.get_statistics();
    EXPECT_EQ(end.contacts.deepest.time_s, 0.0);
    EXPECT_NEAR(end.contacts.deepest.depth_m, kDepth, 1e-9);
    EXPECT_LT(end.contacts.now.depth_m, 2.5e-5);
    EXPECT_GT(end.contacts.pushes, 0);
    EXPECT_GT(end.energy.lifted_j, 0.0);  // the upper one, by at most the depth
    EXPECT_LT(end.energy.lifted_j, 1.01 * spec.bodies[1].bank->rigid.mass_kg * 9.81 * kDepth);
    EXPECT_LT(end.energy.error_j, 1e-9 * end.energy.start_j);
    EXPECT_LT(end.energy.rise_j, 1e-9 * end.energy.start_j);
  }
}

TEST(ContactAudit, DepthInGround) {
  const bank::Bank box = make_box({0.06, 0.05, 0.04});
  WorldSpec spec;
  spec.ground = GroundSpec{};
  spec.bodies = {make_body("box", box, {0, 0, 0.02 - 1e-4})};
  World world(spec, {.end_s = 0.1, .audits_energy = true});
  world.advance(0.0, kForever, [](const events::Event&) {});
  const ContactAudit audit = world.get_statistics().contacts;
  for (const Depth& depth : {audit.now, audit.deepest, audit.unexplained}) {
    EXPECT_NEAR(depth.depth_m, 1e-4, 1e-12);
    EXPECT_EQ(depth.body, 0);
    EXPECT_EQ(depth.other, -1);
    EXPECT_DOUBLE_EQ(depth.thickness_m, 0.04);
  }
}

TEST(ContactAudit, HitCountOfEvents) {
  const bank::Bank ball = make_ball(0.02, 3);
  WorldSpec spec;
  spec.ground = GroundSpec{};
  spec.bodies = {make_body("low", ball, {0, 0, 0.03}, 1.0), make_body("high", ball, {0.1, 0, 0.1}, 1.0)};
  spec.ground->restitution = 0.9;
  constexpr double kEnd = 1.2;
  World world(spec, {.end_s = kEnd, .audits_energy = true});
  std::array<int, 2> late{};
  world.advance(kEnd, kForever, [&](const events::Event& event) {
    const auto* impulse = std::get_if<events::Impulse>(&event);
    if (impulse != nullptr && impulse->time_s > kEnd - 1.0) ++late[impulse->body];
  });
  const ContactAudit audit = world.get_statistics().contacts;
  EXPECT_GT(late[0], late[1]);
  EXPECT_GT(late[1], 2);
  EXPECT_EQ(audit.hits_per_s, late[0] + late[1]);
  EXPECT_EQ(audit.worst_pair.body, 0);
  EXPECT_EQ(audit.worst_pair.other, -1);
  EXPECT_EQ(audit.worst_pair.per_s, late[0]);
  EXPECT_GE(audit.busiest.per_s, late[0]);
  EXPECT_EQ(audit.ended_impacts, 0);
  EXPECT_EQ(audit.longest_impact_s, 0.0);
}

TEST(ContactAudit, EmptyUnlessRequested) {
  const bank::Bank ball = make_ball(0.02, 3);
  WorldSpec spec;
  spec.ground = GroundSpec{};
  spec.bodies = {make_body("ball", ball, {0, 0, 0.1})};
  World world(spec, {.end_s = 0.3});
  world.advance(0.3, kForever, [](const events::Event&) {});
  const Statistics statistics = world.get_statistics();
  EXPECT_EQ(statistics.contacts.deepest.body, -1);
  EXPECT_EQ(statistics.contacts.hits_per_s, 0.0);
  EXPECT_EQ(statistics.energy.lifted_j, 0.0);
}

}  // namespace
}  // namespace carillon::physics::tests
