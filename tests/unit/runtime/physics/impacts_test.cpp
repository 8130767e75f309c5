// Impacts of two bodies, of several spots, on shelves: against the conservation laws.
#include <gtest/gtest.h>

#include <cmath>
#include <set>

#include "runtime/drive/pulses.hpp"
#include "tests/unit/runtime/physics/checks.hpp"
#include "tests/unit/runtime/physics/solids.hpp"

namespace carillon::physics::tests {
namespace {

BodySpec make_body(const char* name, const bank::Bank& bank, Vec3 position, Vec3 velocity = {}) {
  BodySpec b;
  b.name = name;
  b.bank = &bank;
  b.initial.position_m = position;
  b.velocity_m_s = velocity;
  return b;
}

/// Momentum of a body from two poses about `time`.
Vec3 calc_momentum(const bank::Bank& bank, const std::vector<Pose>& path, double from_s, double to_s) {
  const auto centre = [&](double t) {
    const Pose p = pose_at(path, t);
    return p.position_m + rotate(p.rotation, bank.rigid.centre_m);
  };
  return (bank.rigid.mass_kg / (to_s - from_s)) * (centre(to_s) - centre(from_s));
}

TEST(TwoBodies, MomentumOfImpactInFlight) {
  const bank::Bank ball = make_ball(0.03), box = make_box({0.1, 0.06, 0.04});
  WorldSpec w;
  w.gravity_m_s2 = {0, 0, 0};
  w.bodies = {make_body("ball", ball, {}), make_body("box", box, {0.2, 0.011, 0.006}, {-1, 0, 0})};
  const Simulation s = simulate(w, 0.4);
  ASSERT_EQ(s.impulses.size(), 2U);
  const Vec3 j0 = impulse_in_world(s, s.impulses[0]), j1 = impulse_in_world(s, s.impulses[1]);
  EXPECT_LT(norm(j0 + j1), 1e-4 * norm(j0));
  EXPECT_EQ(s.impulses[0].duration_s, s.impulses[1].duration_s);
  EXPECT_EQ(s.impulses[0].time_s, s.impulses[1].time_s);
  EXPECT_EQ(s.impulses[0].other, s.impulses[1].body);
  const Vec3 total = calc_momentum(ball, s.poses[0], 0.2, 0.4) + calc_momentum(box, s.poses[1], 0.2, 0.4);
  EXPECT_LT(norm(total - Vec3{-box.rigid.mass_kg, 0, 0}), 2e-3 * box.rigid.mass_kg);
  // The emitted impulses are the momentum gained by each body.
  EXPECT_LT(norm(calc_momentum(ball, s.poses[0], 0.2, 0.4) - j0), 2e-3 * norm(j0));
}

TEST(TwoBodies, HeadOnNewtonRestitution) {
  const bank::Bank ball = make_ball(0.03), big = make_ball(0.05);
  WorldSpec w;
  w.gravity_m_s2 = {0, 0, 0};
  w.bodies = {make_body("small", ball, {0, 0, 0}, {0, 0, 1}), make_body("big", big, {0, 0, 0.2}, {0, 0, -1})};
  w.bodies[0].restitution = 0.9;
  w.bodies[1].restitution = 0.4;
  const double e = std::sqrt(0.36), m1 = ball.rigid.mass_kg, m2 = big.rigid.mass_kg;
  const Simulation s = simulate(w, 0.3);
  ASSERT_EQ(s.impulses.size(), 2U);
  EXPECT_NEAR(std::abs(s.impulses[0].impulse_n_s[2]), (1 + e) * m1 * m2 / (m1 + m2) * 2.0, 2e-3);
  EXPECT_NEAR(s.impulses[0].time_s - 0.5 * s.impulses[0].duration_s, (0.2 - 0.08) / 2, 1e-5);
}

TEST(Shelf, OppositePulseAtSamePlace) {
  const bank::Bank ball = make_ball(0.03), plate = make_box({0.3, 0.2, 0.01}, {12, 8, 1});
  for (const bool fine : {true, false}) {
    const bank::Bank coarse = make_box({0.3, 0.2, 0.01});
    WorldSpec w;
    w.bodies = {make_body("ball", ball, {0.02, 0.013, 0.5}), make_body("shelf", fine ? plate : coarse, {0, 0, 0.2})};
    w.bodies[1].fixed = true;
    w.bodies[1].initial.rotation = {std::cos(0.17), 0, std::sin(0.17), 0};
    const Simulation s = simulate(w, 0.3);
    ASSERT_EQ(s.impulses.size(), 2U);
    const Impulse &on_ball = s.impulses[0], &on_shelf = s.impulses[1];
    ASSERT_EQ(on_shelf.body, 1);
    EXPECT_LT(norm(impulse_in_world(s, on_ball) + impulse_in_world(s, on_shelf)), 1e-4 * norm(on_ball.impulse_n_s));
    const double touch = on_ball.time_s - 0.5 * on_ball.duration_s;
    const Pose ball_pose = pose_before(s.poses[0], touch), shelf_pose = pose_before(s.poses[1], touch);
    const Vec3 a = ball_pose.position_m + rotate(ball_pose.rotation, point_on_body(ball, on_ball));
    const Vec3 b = shelf_pose.position_m + rotate(shelf_pose.rotation, point_on_body(*w.bodies[1].bank, on_shelf));
    EXPECT_LT(norm(a - b), 1e-3);
    EXPECT_NEAR(on_shelf.barycentric[0] + on_shelf.barycentric[1] + on_shelf.barycentric[2], 1.0, 1e-12);
    // The upper face was struck, downwards, in the shelf's frame.
    EXPECT_NEAR(point_on_body(*w.bodies[1].bank, on_shelf)[2], 0.005, 1e-6);
    EXPECT_LT(on_shelf.impulse_n_s[2], 0.0);
  }
}

TEST(Shelf, EdgeOnEdgeHit) {
  // Two long boxes crosswise, ridge on ridge: no corner is inside the other when they meet.
  const bank::Bank bar = make_box({0.3, 0.02, 0.02});
  WorldSpec w;
  w.bodies = {make_body("falling", bar, {0, 0, 0.2}), make_body("standing", bar, {0, 0, 0})};
  const double c = std::cos(M_PI / 8), d = std::sin(M_PI / 8), h = std::sqrt(0.5);
  w.bodies[0].initial.rotation = {c, d, 0, 0};                  // turned 45 degrees about its length
  w.bodies[1].initial.rotation = {h * c, h * d, h * d, h * c};  // the same, then a quarter turn about z
  w.bodies[1].fixed = true;
  const Simulation s = simulate(w, 0.25);
  ASSERT_GE(s.impulses.size(), 2U);
  const double fall = 0.2 - 2 * 0.02 / std::sqrt(2.0);
  const Impulse& p = s.impulses[0];
  EXPECT_NEAR(p.time_s - 0.5 * p.duration_s, std::sqrt(2 * fall / 9.81), 1e-5);
  EXPECT_NEAR(impulse_in_world(s, p)[2], 1.5 * bar.rigid.mass_kg * std::sqrt(2 * 9.81 * fall), 1e-3);
}

TEST(Box, FlatLandingWithSharedImpulse) {
  const bank::Bank box = make_box({0.1, 0.06, 0.04});
  WorldSpec w;
  w.ground = GroundSpec{};
  w.bodies = {make_body("box", box, {0, 0, 0.22})};
  const Simulation s = simulate(w, 0.25);
  ASSERT_EQ(s.impulses.size(), 4U);
  Vec3 sum{};
  std::set<std::pair<bool, bool>> corners;
  for (const Impulse& p : s.impulses) {
    sum = sum + p.impulse_n_s;
    const Vec3 x = point_on_body(box, p);
    corners.insert({x[0] > 0, x[1] > 0});
    EXPECT_NEAR(p.impulse_n_s[2], s.impulses[0].impulse_n_s[2], 1e-6);
  }
  EXPECT_EQ(corners.size(), 4U);
  EXPECT_NEAR(sum[2], 1.5 * box.rigid.mass_kg * std::sqrt(2 * 9.81 * 0.2), 1e-3);
}

TEST(Box, PulseAtSecondEdgeOfTippingBox) {
  for (const int cells : {1, 6}) {
    const bank::Bank box = make_box({0.1, 0.06, 0.04}, {cells, cells, cells});
    WorldSpec w;
    w.ground = GroundSpec{};
    w.ground->restitution = 0.2;
    w.bodies = {make_body("box", box, {})};
    w.bodies[0].restitution = 0.2;
    w.bodies[0].friction = 2.0;  // it turns about its edge and does not slide
    // Held up by 15 degrees about the edge at x = -0.05.
    const double tilt = -15 * M_PI / 180;
    w.bodies[0].initial.rotation = {std::cos(tilt / 2), 0, std::sin(tilt / 2), 0};
    const Vec3 edge = rotate(w.bodies[0].initial.rotation, {-0.05, 0, -0.02});
    w.bodies[0].initial.position_m = {-0.05 - edge[0], 0, -edge[2]};
    const Simulation s = simulate(w, 0.3);
    ASSERT_FALSE(s.impulses.empty());
    double push = 0.0, moment = 0.0, far_edge = 0.0;
    for (const Impulse& p : s.impulses) {
      if (p.time_s > s.impulses[0].time_s + 1e-3) continue;
      const double x = point_on_body(box, p)[0];
      push += p.impulse_n_s[2];
      moment += x * p.impulse_n_s[2];
      if (x > 0.04) far_edge += p.impulse_n_s[2];
    }
    EXPECT_GT(far_edge, 0.2 * push) << "the far edge lands";
    EXPECT_GT(moment, 0.0) << "most of it beyond the middle";
    // Energy: I_edge w^2 / 2 = m g (drop of the centre).
    const double m = box.rigid.mass_kg, inertia = box.rigid.inertia_kg_m2[4] + m * (0.05 * 0.05 + 0.02 * 0.02);
    const double drop = w.bodies[0].initial.position_m[2] - 0.02;
    const double spin = std::sqrt(2 * m * 9.81 * drop / inertia);
    const double swing = s.impulses[0].time_s;
    EXPECT_GT(swing, 0.03);
    EXPECT_LT(swing, 0.2);
    Vec3 sum{};
    for (const Impulse& p : s.impulses) {
      if (p.time_s < swing + 2e-3) sum = sum + p.impulse_n_s;
    }
    // The far edge bounces and the near one may lift: between a dead landing about the far edge and a full bounce about the near one.
    EXPECT_GT(sum[2], 0.2 * m * spin * 0.05);
    EXPECT_LT(sum[2], 2.0 * m * spin * 0.1);
  }
}

TEST(Box, MomentumOfTumblingBox) {
  const bank::Bank box = make_box({0.1, 0.06, 0.04}, {3, 3, 3}), plate = make_box({0.4, 0.4, 0.02});
  WorldSpec w;
  w.ground = GroundSpec{};
  w.bodies = {make_body("box", box, {0, 0, 0.5}, {0.3, 0.1, 0}), make_body("shelf", plate, {0, 0, 0.2})};
  w.bodies[0].initial.rotation = {0.8, 0.3, 0.5, 0.1};
  w.bodies[0].angular_velocity_rad_s = {2, 7, -4};
  w.bodies[1].fixed = true;
  w.bodies[1].initial.rotation = {std::cos(0.2), 0, std::sin(0.2), 0};
  const Simulation s = simulate(w, 0.452);
  // Weigh the whole flight from before the first touch to the end: p(end) - p(start) = sum J + m g t, while nothing rests yet.
  Vec3 emitted{}, from_shelf{};
  for (const Impulse& p : s.impulses) {
    if (p.time_s - 0.5 * p.duration_s > 0.446) continue;
    if (p.body == 0) emitted = emitted + impulse_in_world(s, p);
    if (p.body == 1) from_shelf = from_shelf + impulse_in_world(s, p);
  }
  const Vec3 gained = calc_momentum(box, s.poses[0], 0.446, 0.45) - calc_momentum(box, s.poses[0], 0.0, 0.004);
  const Vec3 expected = emitted + Vec3{0, 0, -9.81 * box.rigid.mass_kg * 0.446};
  EXPECT_GT(norm(emitted), 0.5 * box.rigid.mass_kg);
  EXPECT_LT(norm(gained - expected), 0.01 * norm(emitted));
  EXPECT_LT(norm(emitted + from_shelf), 0.02 * norm(emitted)) << "only the shelf was hit so far";
}

TEST(Stack, RestAfterCommonFall) {
  const bank::Bank box = make_box({0.06, 0.06, 0.04}, {2, 2, 2});
  WorldSpec w;
  w.ground = GroundSpec{};
  for (const double z : {0.05, 0.12, 0.19}) w.bodies.push_back(make_body("box", box, {0.002 * z, 0, z}));
  const Simulation s = simulate(w, 2.0);
  std::set<std::pair<int, int>> pairs;
  for (const Impulse& p : s.impulses) {
    pairs.insert({p.body, p.other});
    EXPECT_LT(p.time_s, 1.2);
  }
  EXPECT_TRUE(pairs.count({0, -1}) && pairs.count({0, 1}) && pairs.count({1, 0}) && pairs.count({1, 2}) && pairs.count({2, 1}));
  for (int i = 0; i < 3; ++i) EXPECT_NEAR(s.poses[i].back().position_m[2], 0.02 + 0.04 * i, 2e-4);
}

TEST(HollowBody, ContactOfOuterWallOnly) {
  bank::Bank shell = make_ball(0.05, 3);
  const bank::Bank inner = make_ball(0.045, 3);
  const auto count = static_cast<std::int32_t>(shell.vertices_m.size());
  shell.vertices_m.insert(shell.vertices_m.end(), inner.vertices_m.begin(), inner.vertices_m.end());
  for (const auto& t : inner.triangles) shell.triangles.push_back({t[0] + count, t[2] + count, t[1] + count});
  WorldSpec w;
  w.ground = GroundSpec{};
  w.bodies = {make_body("shell", shell, {0, 0, 0.15})};
  const Simulation s = simulate(w, 0.2);
  ASSERT_EQ(s.impulses.size(), 1U);
  EXPECT_LT(s.impulses[0].triangle, static_cast<std::int32_t>(inner.triangles.size()));
  EXPECT_NEAR(norm(point_on_body(shell, s.impulses[0])), 0.05, 1e-6);
}

TEST(Masks, MaskingOfMuchWeakerHits) {
  constexpr double kLength = 5e-4;
  drive::Masks masks(2);
  EXPECT_FALSE(masks.take(0, 1.0, 1.0, kLength));
  EXPECT_TRUE(masks.take(0, 1.001, 0.0045, kLength));
  EXPECT_FALSE(masks.take(0, 1.001, 0.0051, kLength));
  EXPECT_FALSE(masks.take(1, 1.001, 0.001, kLength)) << "another body";
  EXPECT_TRUE(masks.take(0, 1.001, 0.001, 2.0 * kLength));
  // A hard tap is heard above a soft blow, whose spectrum ends below it.
  EXPECT_FALSE(masks.take(0, 1.001, 0.001, 0.1 * kLength));
  // Masks decay by 60 dB in a third of a second, and masked hits mask no others.
  EXPECT_FALSE(masks.take(0, 1.35, 0.001, kLength));
  // An impact reported late by a step does not increase the mask.
  EXPECT_TRUE(masks.take(0, 1.3495, 4e-6, kLength));
}

}  // namespace
}  // namespace carillon::physics::tests
