// Falling, bouncing, resting: against the closed forms of a point mass.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/runtime/physics/checks.hpp"
#include "tests/unit/runtime/physics/solids.hpp"

namespace carillon::physics::tests {
namespace {

constexpr double kGravity = 9.81;

BodySpec make_body(const char* name, const bank::Bank& bank, Vec3 position, double restitution = 0.5) {
  BodySpec b;
  b.name = name;
  b.bank = &bank;
  b.initial.position_m = position;
  b.restitution = restitution;
  return b;
}

WorldSpec make_ground_world(BodySpec body, double friction = 0.5) {
  WorldSpec w;
  w.ground = GroundSpec{};
  w.ground->restitution = body.restitution;
  w.ground->friction = friction;
  body.friction = friction;
  w.bodies = {std::move(body)};
  return w;
}

class DroppedBall : public testing::TestWithParam<std::tuple<double, double, double>> {};

/// radius, height of fall, restitution
INSTANTIATE_TEST_SUITE_P(Sizes, DroppedBall,
                         testing::Values(std::tuple{0.03, 0.5, 0.5}, std::tuple{0.03, 2.0, 0.8}, std::tuple{0.01, 0.1, 0.3},
                                         std::tuple{0.25, 1.0, 0.6}, std::tuple{0.03, 0.01, 0.5}, std::tuple{0.03, 0.3, 0.0},
                                         std::tuple{0.03, 5.0, 0.95}));

TEST_P(DroppedBall, ContactAndBounceTimesOfClosedForm) {
  const auto [radius, height, e] = GetParam();
  const bank::Bank ball = make_ball(radius);
  const double first = std::sqrt(2 * height / kGravity), v = kGravity * first;
  const Simulation s = simulate(make_ground_world(make_body("ball", ball, {0, 0, radius + height}, e)), first * 4 + 0.3);
  double touch = first, speed = v;
  int bounce = 0;
  for (; speed > 0.05 && bounce < 6 && touch < first * 4; ++bounce) {
    ASSERT_GT(s.impulses.size(), static_cast<std::size_t>(bounce)) << "a hit is missing";
    const Impulse& p = s.impulses[bounce];
    EXPECT_NEAR(p.time_s - 0.5 * p.duration_s, touch, 1e-4) << "bounce " << bounce;
    EXPECT_NEAR(p.impulse_n_s[2], (1 + e) * ball.rigid.mass_kg * speed, 0.01 * ball.rigid.mass_kg * speed) << "bounce " << bounce;
    EXPECT_NEAR(p.impulse_n_s[0], 0.0, 1e-6);
    EXPECT_EQ(p.body, 0);
    EXPECT_EQ(p.other, -1);
    // The lowest point of the ball.
    const Vec3 x = point_on_body(ball, p);
    EXPECT_NEAR(x[2], -radius, 1e-9);
    if (e == 0.0) break;
    speed *= e;
    touch += 2 * speed / kGravity;
  }
  if (e == 0.0) {
    EXPECT_EQ(s.impulses.size(), 1U) << "a dead ball hits once";
  } else {
    EXPECT_GE(bounce, 2);
  }
}

TEST(Ball, HertzDurationForTwoMaterials) {
  // Johnson (1985) 11.24: 2.87 (m^2 / (R E*^2 v))^(1/5), ball on a flat.
  const double radius = 0.03;
  const bank::Bank ball = make_ball(radius, 5);
  WorldSpec w = make_ground_world(make_body("ball", ball, {0, 0, radius + 0.5}));
  w.ground->young_modulus_pa = 10e9;
  w.ground->poisson_ratio = 0.25;
  const Simulation s = simulate(w, 0.4);
  ASSERT_EQ(s.impulses.size(), 1U);
  const double modulus = 1.0 / ((1 - 0.33 * 0.33) / 5.45e9 + (1 - 0.0625) / 10e9), v = std::sqrt(2 * kGravity * 0.5);
  const double mass = ball.rigid.mass_kg;
  const double expected = 2.87 * std::pow(mass * mass / (radius * modulus * modulus * v), 0.2);
  EXPECT_NEAR(s.impulses[0].duration_s, expected, 0.03 * expected);
}

TEST(Ball, SilenceInFreeFlight) {
  const bank::Bank ball = make_ball(0.03);
  WorldSpec w;
  w.bodies = {make_body("ball", ball, {0, 0, 1})};
  w.bodies[0].velocity_m_s = {1, 0, 2};
  w.bodies[0].angular_velocity_rad_s = {3, 2, 1};
  const Simulation s = simulate(w, 1.0);
  EXPECT_TRUE(s.impulses.empty());
  const Pose& end = s.poses[0].back();
  EXPECT_NEAR(end.time_s, 1.0, 1e-12);
  EXPECT_NEAR(end.position_m[0], 1.0, 1e-6);
  EXPECT_NEAR(end.position_m[2], 1 + 2 - 0.5 * kGravity, 1e-6);
}

TEST(Ball, ObliqueImpactWithinFrictionCone) {
  const bank::Bank ball = make_ball(0.03);
  WorldSpec w = make_ground_world(make_body("ball", ball, {0, 0, 0.33}), 0.2);
  w.bodies[0].velocity_m_s = {3, 1, 0};
  const Simulation s = simulate(w, 0.3);
  ASSERT_GE(s.impulses.size(), 1U);
  const Vec3 j = impulse_in_world(s, s.impulses[0]);
  // Fast sliding: the whole cone is used, straight against the motion.
  EXPECT_NEAR(std::hypot(j[0], j[1]), 0.2 * j[2], 1e-3 * j[2]);
  EXPECT_NEAR(j[0] / j[1], 3.0, 0.02);
  EXPECT_LT(j[0], 0.0);
}

TEST(Ball, RollingAtFiveSeventhsAfterGrip) {
  // A ball that lands sliding and sticks: angular momentum about the contact gives v = 5/7 v0.
  const bank::Bank ball = make_ball(0.03);
  WorldSpec w = make_ground_world(make_body("ball", ball, {0, 0, 0.33}), 2.0);
  w.bodies[0].velocity_m_s = {0.7, 0, 0};
  const Simulation s = simulate(w, 0.3);
  ASSERT_EQ(s.impulses.size(), 1U);
  EXPECT_NEAR(impulse_in_world(s, s.impulses[0])[0], -2.0 / 7.0 * 0.7 * ball.rigid.mass_kg, 1e-3 * ball.rigid.mass_kg);
}

class Resting : public testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Sizes, Resting, testing::Values(0.02, 0.1, 0.5));

TEST_P(Resting, SilentBoxAtRest) {
  const double size = GetParam();
  const bank::Bank box = make_box({size, 0.8 * size, 0.5 * size}, {4, 4, 2});
  const Simulation s = simulate(make_ground_world(make_body("box", box, {0, 0, 0.25 * size})), 2.0);
  EXPECT_TRUE(s.impulses.empty());
  EXPECT_NEAR(s.poses[0].back().position_m[2], 0.25 * size, 1e-4);
  EXPECT_NEAR(s.poses[0].back().position_m[0], 0.0, 1e-4);
}

TEST_P(Resting, SilenceAfterComingToRest) {
  const double size = GetParam();
  const bank::Bank box = make_box({size, 0.8 * size, 0.5 * size});
  WorldSpec w = make_ground_world(make_body("box", box, {0, 0, 1.5 * size}));
  w.bodies[0].initial.rotation = {0.9, 0.3, 0.2, 0.1};
  const double settled = 3.0 * std::sqrt(std::max(1.0, size / 0.1));
  const Simulation s = simulate(w, settled + 2.0);
  ASSERT_FALSE(s.impulses.empty());
  EXPECT_LT(s.impulses.back().time_s, settled);
  EXPECT_LT(s.impulses.size(), 150U) << "a machine-gun";
}

TEST_P(Resting, NoEnergyGain) {
  const double size = GetParam();
  const bank::Bank box = make_box({size, 0.8 * size, 0.5 * size});
  WorldSpec w = make_ground_world(make_body("box", box, {0, 0, 2 * size}, 0.8));
  w.bodies[0].initial.rotation = {0.9, 0.3, -0.2, 0.4};
  w.bodies[0].angular_velocity_rad_s = {5, -3, 2};
  const Simulation s = simulate(w, 1.5);
  const auto energies = calc_energies(box, s.poses[0], kGravity);
  double allowed = energies.front().energy_j * 1.002;
  for (const auto& e : energies) {
    // A difference across an impact sees neither the speed before nor the one after.
    bool clear = true;
    for (const Impulse& p : s.impulses) clear = clear && std::abs(p.time_s - 0.5 * p.duration_s - e.time_s) > 2e-3;
    if (!clear) continue;
    EXPECT_LE(e.energy_j, allowed) << "at " << e.time_s << " s";
    allowed = std::min(allowed, e.energy_j + 0.003 * energies.front().energy_j);
  }
  EXPECT_LT(energies.back().energy_j, 0.9 * energies.front().energy_j);
}

TEST(Simulate, PosesAndProgress) {
  const bank::Bank ball = make_ball(0.03);
  const bank::Bank plate = make_box({0.3, 0.2, 0.01});
  WorldSpec w = make_ground_world(make_body("ball", ball, {0, 0, 0.2}));
  w.bodies.push_back(make_body("shelf", plate, {1, 0, 0.5}));
  w.bodies[1].fixed = true;
  double last = 0.0;
  const Simulation s = simulate(w, 0.5, [&](double f) {
    EXPECT_GE(f, last);
    last = f;
  });
  EXPECT_EQ(last, 1.0);
  ASSERT_EQ(s.poses.size(), 2U);
  EXPECT_EQ(s.poses[1].size(), 2U);
  EXPECT_LE(s.poses[0].size(), 251U + s.impulses.size());
  EXPECT_GE(s.poses[0].size(), 100U);
  for (const auto& path : s.poses) {
    EXPECT_EQ(path.front().time_s, 0.0);
    EXPECT_NEAR(path.back().time_s, 0.5, 1e-8);
  }
}

}  // namespace
}  // namespace carillon::physics::tests
