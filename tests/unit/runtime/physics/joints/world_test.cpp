// Worlds with joints, cords and ringing bodies: energy balance, momentum, refusals.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/runtime/physics/bodies.hpp"

namespace carillon::physics::tests {
namespace {

using joints::Kind;

BodySpec make_springy(const std::string& name, const bank::Bank& bank, const Vec3& position) {
  return make_body(name, bank, position, 0.6);
}

/// Banks of the scenes below.
struct Things {
  bank::Bank ball = add_modes(make_ball(0.03, 3), 20);
  bank::Bank clapper = make_ball(0.02, 3);
  bank::Bank plate = add_modes(make_box({0.3, 0.01, 0.2}), 20);
  bank::Bank tube = add_modes(make_box({0.03, 0.03, 0.4}), 20);
  bank::Bank link = make_box({0.01, 0.01, 0.06});
};

WorldSpec make_scene(const Things& t, int which) {
  WorldSpec w;
  switch (which) {
    case 0:  // a ringing ball on a ball joint against a fixed plate that rings
      w.bodies = {make_springy("ball", t.ball, {0, 0.3, 0}), make_springy("plate", t.plate, {0, -0.036, -0.35})};
      w.bodies[1].fixed = true;
      w.joints = {{.kind = Kind::kBall, .body = 0, .to = -1, .at_m = {0, 0, 0}}};
      break;
    case 1:  // against a plate on a hinge
      w.bodies = {make_springy("ball", t.ball, {0, 0.3, 0}), make_springy("plate", t.plate, {0, -0.036, -0.3})};
      w.joints = {{.kind = Kind::kBall, .body = 0, .to = -1, .at_m = {0, 0, 0}},
                  {.kind = Kind::kHinge, .body = 1, .to = -1, .at_m = {0, -0.036, -0.2}, .axis = {1, 0, 0}}};
      break;
    case 2:  // a free ball against a plate on a hinge, and the ground
      w.bodies = {make_springy("ball", t.ball, {0.05, 0.5, -0.3}), make_springy("plate", t.plate, {0, 0, -0.3})};
      w.bodies[0].velocity_m_s = {0, -3, 1};
      w.joints = {{.kind = Kind::kHinge, .body = 1, .to = -1, .at_m = {0, 0, -0.2}, .axis = {1, 0, 0}}};
      w.ground = GroundSpec{.height_m = -0.8};
      break;
    case 3:  // a tube on two cords and a clapper on one
      w.bodies = {make_springy("tube", t.tube, {0, 0, -0.3}), make_springy("clapper", t.clapper, {0.09, 0, -0.3})};
      w.bodies[1].velocity_m_s = {-1.2, 0.05, 0};
      w.cords = {{.body = 0, .to = -1, .from_m = {0.015, 0, -0.1}, .to_m = {0.015, 0, 0.1}},
                 {.body = 0, .to = -1, .from_m = {-0.015, 0, -0.1}, .to_m = {-0.015, 0, 0.1}},
                 {.body = 1, .to = -1, .from_m = {0.09, 0, -0.28}, .to_m = {0.09, 0, 0.1}}};
      break;
    default:  // a chain of three links with a ball at its end
      w.bodies = {make_springy("plate", t.plate, {0, -0.037, -0.3})};
      w.bodies[0].fixed = true;
      for (int i = 0; i < 3; ++i) {
        w.bodies.push_back(make_springy("link" + std::to_string(i), t.link, {0, 0.03 + 0.06 * i, 0}));
        w.bodies.back().initial.rotation = {std::sqrt(0.5), std::sqrt(0.5), 0, 0};
        w.joints.push_back({.kind = Kind::kBall, .body = i + 1, .to = i == 0 ? -1 : i, .at_m = {0, 0.06 * i, 0}});
      }
      w.bodies.push_back(make_springy("ball", t.ball, {0, 0.21, 0}));
      w.joints.push_back({.kind = Kind::kBall, .body = 4, .to = 3, .at_m = {0, 0.18, 0}});
      break;
  }
  return w;
}

class JointedBooks : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Scenes, JointedBooks, testing::Range(0, 5));

TEST_P(JointedBooks, EnergyBalanceWithinOnePercent) {
  const Things things;
  const Outcome r = run_audited(make_scene(things, GetParam()), 1.0);
  RecordProperty("error_j", std::to_string(r.energy.error_j));
  EXPECT_FALSE(r.forces.empty()) << "no impact with modes";
  EXPECT_GT(r.energy.max_modes_j, 1e-4 * r.energy.kinetic_j);
  EXPECT_LT(r.energy.error_j, 0.01 * r.energy.kinetic_j);
  EXPECT_LT(r.energy.max_modes_j, r.energy.kinetic_j);
}

TEST(Jointed, SameBitsInAnySlices) {
  const Things things;
  const Outcome one = run_audited(make_scene(things, 1), 0.5);
  World world(make_scene(things, 1), {.end_s = 0.5, .audits_energy = true});
  std::size_t n = 0;
  double reached = 0.0;
  while (reached < 0.5 - 1e-6)
    reached = world.advance(reached + 1e-3, 1e-5, [&](const events::Event& event) {
      ASSERT_LT(n, one.events.size());
      EXPECT_EQ(events::get_time_s(event), events::get_time_s(one.events[n]));
      if (const auto* m = std::get_if<events::BodyMotion>(&event)) {
        EXPECT_EQ(m->position_m, std::get<events::BodyMotion>(one.events[n]).position_m);
      }
      ++n;
    });
  EXPECT_EQ(n, one.events.size());
}

TEST(Jointed, AngularMomentumAboutHinge) {
  // Without gravity: a ball flies into a plate on a hinge; both ring. About the hinge nothing is lost.
  const Things things;
  WorldSpec w = make_scene(things, 2);
  w.ground.reset();
  w.gravity_m_s2 = {};
  w.bodies[0].velocity_m_s = {0, -3, 0};
  w.bodies[0].friction = w.bodies[1].friction = 0.0;
  const double m = things.ball.rigid.mass_kg, arm = 0.1;
  const Outcome r = run_audited(w, 0.3);
  ASSERT_FALSE(r.forces.empty());
  const events::BodyMotion ball = find_last(r, 0), plate = find_last(r, 1), before = find_last(r, 1, 0.29);
  const auto& bank = things.plate.rigid;
  const double inertia = bank.inertia_kg_m2[0] + bank.mass_kg * 0.01;
  const double spin = norm(plate.velocity_m_s) / 0.1, old = norm(before.velocity_m_s) / 0.1;
  EXPECT_NEAR(spin, old, 1e-9);  // turns on
  const double given = m * arm * 3.0, kept = m * arm * -ball.velocity_m_s[1];
  EXPECT_NEAR(inertia * spin + kept, given, 2e-3 * given);
}

template <typename Change>
std::string find_refusal(Change&& change) {
  const Things things;
  WorldSpec w = make_scene(things, 1);
  change(w);
  return carillon::tests::catch_message<InputError>([&] { World world(w, {}); });
}

TEST(Jointed, RefusalByName) {
  const auto contains = [](const std::string& text, const char* part) { return text.find(part) != std::string::npos; };
  EXPECT_EQ(find_refusal([](WorldSpec&) {}), "");
  EXPECT_TRUE(contains(find_refusal([](WorldSpec& w) { w.joints.push_back({.kind = Kind::kBall, .body = 1, .to = 0, .at_m = {}}); }),
                       "the joint between 'plate' and 'ball' closes a loop"));
  EXPECT_TRUE(contains(find_refusal([](WorldSpec& w) { w.joints[1].kind = Kind::kWeld; }), "set \"fixed\""));
  EXPECT_TRUE(contains(find_refusal([](WorldSpec& w) { w.joints[1].body = 0, w.joints[1].to = 0; }), "to itself"));
  EXPECT_TRUE(contains(find_refusal([](WorldSpec& w) { w.bodies[1].fixed = true; }), "two bodies that do not move"));
  EXPECT_TRUE(contains(find_refusal([](WorldSpec& w) { w.bodies[0].velocity_m_s = {0, 1, 0}; }), "those that its joints allow"));
  EXPECT_TRUE(contains(find_refusal([](WorldSpec& w) { w.joints[1].damping = -1.0; }), "damping"));
  EXPECT_TRUE(contains(find_refusal([](WorldSpec& w) { w.joints[1].axis = {}; }), "axis"));
  EXPECT_TRUE(contains(find_refusal([](WorldSpec& w) { w.joints[1].limits = {0.1, 0.2}; }), "must enclose the start"));
  EXPECT_TRUE(contains(find_refusal([](WorldSpec& w) { w.joints[1].limits = {-4.0, 0.2}; }), "within 3.05433 rad"));
  EXPECT_TRUE(contains(find_refusal([](WorldSpec& w) { w.joints[1].limits = {-1, 1}, w.joints[1].stop_restitution = 2; }), "of its stops"));
  EXPECT_TRUE(contains(find_refusal([](WorldSpec& w) { w.joints[1].kind = Kind::kBall, w.joints[1].limits = {-1, 1}; }), "only hinges"));
  EXPECT_TRUE(contains(find_refusal([](WorldSpec& w) {
                         w.cords.push_back({.body = 0, .to = 1, .from_m = {0, 0.3, 0}, .to_m = {0, 0, -0.3}, .length_m = 0.2});
                       }),
                       "it is 0.2 m long"));
  EXPECT_TRUE(contains(find_refusal([](WorldSpec& w) { w.cords.push_back({.body = 0, .to = -1, .from_m = {}, .to_m = {}}); }),
                       "its ends coincide"));
}

TEST(Jointed, StopsInAnyBodyOrder) {
  // A ball that hangs 0.3 m to the side of a hinge may fall by 0.5 rad; then it is thrown back, and comes to rest there.
  const bank::Bank ball = make_ball(0.03, 3), post = make_box({0.05, 0.05, 0.05});
  for (const bool turned : {false, true}) {
    WorldSpec w;
    w.bodies = {make_body("ball", ball, {0.3, 0, 0}), make_body("post", post, {0, 0.3, 0})};
    w.bodies[1].fixed = true;
    JointSpec hinge{.kind = Kind::kHinge, .body = turned ? 1 : 0, .to = turned ? 0 : 1, .at_m = {}, .axis = {0, 1, 0}};
    hinge.limits = turned ? std::array<double, 2>{-0.5, 0.1} : std::array<double, 2>{-0.1, 0.5};
    hinge.stop_restitution = 0.5;
    w.joints = {hinge};
    const Outcome r = run_audited(w, 3.0);
    double lowest = 0.0, after = -1.0;
    for (const events::Event& event : r.events)
      if (const auto* m = std::get_if<events::BodyMotion>(&event); m != nullptr && m->body == 0) {
        lowest = std::min(lowest, m->position_m[2]);
        if (m->velocity_m_s[2] > 0.0) after = std::max(after, norm(m->velocity_m_s));
      }
    EXPECT_NEAR(lowest, -0.3 * std::sin(0.5), 1e-4);
    EXPECT_NEAR(find_last(r, 0).position_m[2], -0.3 * std::sin(0.5), 1e-4);
    const double inertia = ball.rigid.mass_kg * 0.09 + ball.rigid.inertia_kg_m2[4];
    EXPECT_NEAR(after, 0.5 * 0.3 * std::sqrt(2.0 * ball.rigid.mass_kg * 9.81 * 0.3 * std::sin(0.5) / inertia), 0.02 * after);
    EXPECT_LT(r.energy.error_j, 1e-3 * ball.rigid.mass_kg);
  }
}

TEST(Jointed, QuestionsAboutDistantLinks) {
  const Things things;
  WorldSpec w = make_scene(things, 1);
  EXPECT_TRUE(ask_about_links(w).empty());
  w.joints[0].at_m = {0, 0, 3.0};
  w.cords.push_back({.body = 1, .to = -1, .from_m = {0, 1, 0}, .to_m = {0, 2, 0}});
  EXPECT_EQ(ask_about_links(w).size(), 2u);
}

}  // namespace
}  // namespace carillon::physics::tests
