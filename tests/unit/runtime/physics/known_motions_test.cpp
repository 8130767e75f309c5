// Motions with a closed form or a published solution: rolling bodies, a ball in a bowl, dominoes.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "tests/unit/runtime/physics/bodies.hpp"
#include "tests/unit/runtime/physics/leaning_train.hpp"
#include "tests/unit/runtime/physics/rigid/drops.hpp"

namespace carillon::physics::tests {
namespace {

constexpr double kGravity = 9.81;
constexpr double kRollingResistance = 1e-3;  // docs/decisions/contact.md

/// Facets on the sphere, mass and inertia of the true ball. 20 n^2 triangles.
bank::Bank make_round(double radius_m, int n) {
  bank::Bank ball = make_bank(geometry::tests::make_ball(radius_m, n));
  ball.rigid = make_ball(radius_m, 1).rigid;
  return ball;
}

BodySpec make_body(const bank::Bank& bank, Vec3 position, double friction) {
  BodySpec b = tests::make_body("body", bank, position, 0.0);
  b.friction = friction;
  return b;
}

std::vector<std::vector<events::BodyMotion>> run(const WorldSpec& spec, double end_s, int* hits = nullptr) {
  World world(spec, {.end_s = end_s, .lasting_contacts = false});
  std::vector<std::vector<events::BodyMotion>> motions(spec.bodies.size());
  world.advance(end_s, std::numeric_limits<double>::infinity(), [&](const events::Event& e) {
    if (const auto* m = std::get_if<events::BodyMotion>(&e)) motions[m->body].push_back(*m);
    if (hits != nullptr && std::holds_alternative<Impulse>(e)) ++*hits;
  });
  return motions;
}

const events::BodyMotion& get_at(const std::vector<events::BodyMotion>& motions, double time_s) {
  return *std::min_element(motions.begin(), motions.end(),
                           [&](const auto& a, const auto& b) { return std::abs(a.time_s - time_s) < std::abs(b.time_s - time_s); });
}

class RollingDown : public testing::TestWithParam<std::tuple<double, int>> {};
INSTANTIATE_TEST_SUITE_P(Planes, RollingDown,
                         testing::Combine(testing::Values(1.0, 3.0, 10.0, 20.0),
                                          testing::Values(6, 16)));  // degrees; 720 and 5,120 triangles

TEST_P(RollingDown, AccelerationOfFiveSeventhsLessResistance) {
  const auto [degrees, n] = GetParam();
  const double a = degrees * M_PI / 180, radius = 0.03;
  const bank::Bank ball = make_round(radius, n), plane = make_box({4.0, 0.4, 0.04});
  WorldSpec w;
  w.bodies = {make_body(ball, {}, 0.5), make_body(plane, {0, 0, 0}, 0.5)};
  w.bodies[1].fixed = true;
  w.bodies[1].initial.rotation = {std::cos(a / 2), 0, std::sin(a / 2), 0};
  const Vec3 down{std::cos(a), 0, -std::sin(a)}, up{std::sin(a), 0, std::cos(a)};
  w.bodies[0].initial.position_m = (radius + 0.02) * up - 1.9 * down;
  const auto motions = run(w, 1.2)[0];
  const double expected = 5.0 / 7.0 * kGravity * (std::sin(a) - kRollingResistance * std::cos(a));
  const auto speed = [&](double t) {
    const Vec3& v = get_at(motions, t).velocity_m_s;
    return v[0] * down[0] + v[2] * down[2];
  };
  EXPECT_NEAR((speed(1.1) - speed(0.1)) / expected, 1.0, n < 10 ? 0.01 : 0.002);
  EXPECT_NEAR(motions.back().velocity_m_s[1], 0.0, 0.01 * speed(1.2)) << "to the side";
}

TEST(Rolling, LossByRollingResistance) {
  const bank::Bank coarse = make_round(0.03, 6), fine = make_round(0.03, 16);
  // Of the ground and the ball, the larger one counts.
  for (const auto& [of_ground, of_ball] : {std::pair(kRollingResistance, kRollingResistance), {0.01, kRollingResistance}, {0.0, 0.005}})
    for (const bank::Bank* ball : {&coarse, &fine}) {
      WorldSpec w;
      w.ground = GroundSpec{.rolling_resistance = of_ground};
      w.bodies = {make_body(*ball, {0, 0, 0.03}, 0.5)};
      w.bodies[0].rolling_resistance = of_ball;
      w.bodies[0].velocity_m_s = {0.5, 0, 0};
      w.bodies[0].angular_velocity_rad_s = {0, 0.5 / 0.03, 0};
      int hits = 0;
      const auto motions = run(w, 4.0, &hits)[0];
      const double lost = 5.0 / 7.0 * std::max(of_ground, of_ball) * kGravity * 4.0;
      EXPECT_NEAR((0.5 - motions.back().velocity_m_s[0]) / lost, 1.0, 0.05) << of_ground << " " << of_ball;
      EXPECT_EQ(hits, 0) << of_ground << " " << of_ball;
    }
}

TEST(Rolling, NoHitsOverFacets) {
  const bank::Bank ball = make_round(0.03, 6);
  for (const double speed : {0.51, 0.54, 0.55, 0.57}) {
    WorldSpec w;
    w.ground = GroundSpec{};
    w.bodies = {make_body(ball, {0, 0, 0.03}, 0.5)};
    w.bodies[0].velocity_m_s = {speed, 0, 0};
    w.bodies[0].angular_velocity_rad_s = {0, speed / 0.03, 0};
    int hits = 0;
    run(w, 4.0, &hits);
    EXPECT_EQ(hits, 0) << speed << " m/s";
  }
}

TEST(Rolling, AccelerationOfFastPen) {
  // 20 facets: it stays on the plane in steps of up to 0.25 rad.
  const double a = 5.0 * M_PI / 180, radius = 0.0045, end_s = 2.0;
  const bank::Bank pen = make_bank(rigid::tests::make_drop_surface(4));
  WorldSpec w;
  w.ground = GroundSpec{};
  w.gravity_m_s2 = {kGravity * std::sin(a), 0, -kGravity * std::cos(a)};
  w.bodies = {make_body(pen, {0, 0, radius}, 0.4)};
  w.bodies[0].initial.rotation = {std::sqrt(0.5), std::sqrt(0.5), 0, 0};
  const double inertia = pen.rigid.inertia_kg_m2[8] / (pen.rigid.mass_kg * radius * radius);
  const double expected = kGravity * (std::sin(a) - kRollingResistance * std::cos(a)) / (1.0 + inertia);
  int hits = 0;
  EXPECT_NEAR(get_at(run(w, end_s, &hits)[0], end_s).position_m[0] / (0.5 * expected * end_s * end_s), 1.0, 0.002);
  EXPECT_EQ(hits, 0);
}

class SlidingToRolling : public testing::TestWithParam<std::tuple<double, double>> {};
INSTANTIATE_TEST_SUITE_P(Speeds, SlidingToRolling, testing::Combine(testing::Values(0.5, 1.0, 2.0), testing::Values(0.1, 0.3)));

TEST_P(SlidingToRolling, FinalSpeedAndTime) {
  const auto [speed, friction] = GetParam();
  const bank::Bank ball = make_round(0.03, 8);
  WorldSpec w;
  w.ground = GroundSpec{.friction = friction};
  w.bodies = {make_body(ball, {0, 0, 0.03}, friction)};
  w.bodies[0].velocity_m_s = {speed, 0, 0};
  const double rolls_s = 2.0 / 7.0 * speed / (friction * kGravity);
  const auto motions = run(w, 1.2 * rolls_s)[0];
  // Until it rolls the resistance takes a share c / mu more or less.
  EXPECT_NEAR(get_at(motions, 0.5 * rolls_s).velocity_m_s[0], speed * (1.0 - 1.0 / 7.0), 0.01 * speed);
  EXPECT_NEAR(get_at(motions, 1.1 * rolls_s).velocity_m_s[0], 5.0 / 7.0 * speed, 0.01 * speed);
}

TEST(Bowl, PeriodOfBallInBowl) {
  // A ball that rolls in a sphere is a pendulum of length (R - r) 7/5: period by the complete elliptic integral.
  const double bowl = 0.15, radius = 0.015;
  std::vector<std::array<double, 2>> outline;
  const int rings = 48;
  for (int i = 0; i <= rings; ++i) {  // outside, from below to the brim
    const double angle = 0.5 * M_PI * i / rings;
    outline.push_back({1.1 * bowl * std::sin(angle), -1.1 * bowl * std::cos(angle)});
  }
  for (int i = rings; i >= 0; --i) {
    const double angle = 0.5 * M_PI * i / rings;
    outline.push_back({bowl * std::sin(angle), -bowl * std::cos(angle)});
  }
  const bank::Bank basin = make_bank(geometry::tests::make_lathe(outline, 96, false)), ball = make_round(radius, 8);
  for (const auto& [degrees, period] : {std::pair{10.0, 0.873783}, std::pair{30.0, 0.887303}}) {
    const double a = degrees * M_PI / 180;
    WorldSpec w;
    w.bodies = {make_body(ball, {(bowl - radius) * std::sin(a), 0, -(bowl - radius) * std::cos(a)}, 0.8), make_body(basin, {}, 0.8)};
    w.bodies[1].fixed = true;
    const auto motions = run(w, 2.2)[0];
    std::vector<double> crossings;
    for (std::size_t i = 1; i < motions.size(); ++i)
      if (motions[i - 1].position_m[0] > 0.0 && motions[i].position_m[0] <= 0.0)
        crossings.push_back(motions[i - 1].time_s + (motions[i].time_s - motions[i - 1].time_s) * motions[i - 1].position_m[0] /
                                                        (motions[i - 1].position_m[0] - motions[i].position_m[0]));
    ASSERT_GE(crossings.size(), 3U);
    const double measured = (crossings[2] - crossings[0]) / 2.0;
    EXPECT_NEAR(measured / period, 1.0, 0.003) << degrees << " degrees";
  }
}

class Dominoes : public testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(FrictionBetweenThem, Dominoes, testing::Values(0.0, 0.1, 0.2, 0.3));

TEST_P(Dominoes, SpeedOfLeaningTrain) {
  struct Row {
    double height_m, thickness_m, gap_m, speed_m_s;  // in the long run, without friction
  };
  const double friction = GetParam();
  for (const Row& row : {Row{0.048, 0.0075, 0.0096, 1.3504}, Row{0.05, 0.005, 0.025, 1.1994}}) {
    const int stones = 28, first = 15, last = 25;
    const double pitch = row.gap_m + row.thickness_m, push = 6.0;  // rad/s
    LeaningTrain train(row.height_m, row.thickness_m, row.gap_m, friction);
    const std::vector<double> expected = train.calc_starts(friction == 0.0 ? 50 : stones, push);
    if (friction == 0.0) {
      EXPECT_NEAR(pitch * 9 / (expected[49] - expected[40]) / row.speed_m_s, 1.0, 2e-3) << "the train itself";
    }
    const bank::Bank stone = make_box({row.thickness_m, 0.024, row.height_m});
    WorldSpec w;
    const double between = std::max(friction, 5e-4);
    w.ground = GroundSpec{.restitution = 0.0, .friction = 25.0 / between};  // 5 at their feet
    for (int i = 0; i < stones; ++i) w.bodies.push_back(make_body(stone, {pitch * i, 0, 0.5 * row.height_m}, between));
    // The first is pushed over its lower edge.
    w.bodies[0].angular_velocity_rad_s = {0, push, 0};
    w.bodies[0].velocity_m_s = {push * 0.5 * row.height_m, 0, push * 0.5 * row.thickness_m};
    const auto motions = run(w, 1.2);
    std::vector<double> starts;  // of each stone: when it moves
    for (const auto& path : motions) {
      const auto found = std::find_if(path.begin(), path.end(), [&](const auto& m) { return m.velocity_m_s[0] > 0.02; });
      starts.push_back(found == path.end() ? -1.0 : found->time_s);
    }
    ASSERT_GT(starts[last], 0.0);
    EXPECT_NEAR((expected[last] - expected[first]) / (starts[last] - starts[first]), 1.0, 0.01) << row.height_m;
  }
}

/// Of a disc on its rim: how fast it turned about the vertical, over a rate, where its centre began and how low it came.
struct Precession {
  double turned = 0.0, lowest_m = 0.0, height_m = 0.0;
};

Precession precess(double radius, double thickness, double lean, double rate, const Vec3& spin, double end_s) {
  const bank::Bank disc = make_bank(geometry::tests::make_cylinder(radius, thickness, 96));
  WorldSpec w;
  w.ground = GroundSpec{.friction = 0.8};
  Precession out;
  out.height_m = out.lowest_m = radius * std::sin(lean) + 0.5 * thickness * std::cos(lean);
  w.bodies = {make_body(disc, {0, 0, out.height_m}, 0.8)};
  w.bodies[0].initial.rotation = {std::cos(lean / 2), std::sin(lean / 2), 0, 0};
  w.bodies[0].angular_velocity_rad_s = spin;
  double before = 0.0;
  bool begun = false;
  const auto path = run(w, end_s)[0];
  for (const auto& m : path) {
    const Vec3 axis = rotate(m.rotation, {0, 0, 1});  // where it leans to
    const double angle = std::atan2(axis[1], axis[0]);
    if (std::exchange(begun, true)) out.turned += std::remainder(angle - before, 2 * M_PI) / (rate * end_s);
    before = angle;
    out.lowest_m = std::min(out.lowest_m, m.position_m[2]);
  }
  out.turned = std::abs(out.turned);
  return out;
}

/// A disc of 1 kg and thickness 2 e that rolls on its rim, by its differential equation. With p from the centre to the touch the velocity
/// of the centre is p x w; the ground pushes with F = dv/dt + g z and resists by a couple against the horizontal part of w that takes c F_z
/// times the way of the touch along the rim: d(I w)/dt = p x F + M.
struct RollingDisc {
  double radius = 0.0, e = 0.0;
  Vec3 k{}, w{};  // axis and spin
  double push = kGravity;

  Vec3 find_touch(const Vec3& axis) const {
    const Vec3 up{0, 0, 1}, up_slope = up - dot(up, axis) * axis;
    return (-radius / norm(up_slope)) * up_slope - e * axis;
  }
  void step(double h) {
    const double across = radius * radius / 4.0 + e * e / 3.0, along = radius * radius / 2.0, tiny = 1e-7;
    const Vec3 p = find_touch(k), dk = cross(w, k), dp = (0.5 / tiny) * (find_touch(k + tiny * dk) - find_touch(k - tiny * dk));
    const Vec3 rolls{w[0], w[1], 0};
    const Vec3 couple = (-kRollingResistance * push * norm(dp - cross(w, p)) / dot(rolls, rolls)) * rolls;
    const Vec3 right = cross(p, cross(dp, w) + Vec3{0, 0, kGravity}) - ((along - across) * dot(w, k)) * dk + couple;
    Mat3 inertia{};
    for (std::size_t i = 0; i < 3; ++i)
      for (std::size_t j = 0; j < 3; ++j)
        inertia[i][j] = (along - across) * k[i] * k[j] - p[i] * p[j] + (i == j ? across + dot(p, p) : 0.0);
    const Vec3 dw = calc_inverse(inertia) * right;
    push = kGravity + (cross(p, dw) + cross(dp, w))[2];
    w = w + h * dw;
    k = k + h * cross(w, k);
    k = (1.0 / norm(k)) * k;
  }
  /// Angle about the vertical after a time.
  double roll(double end_s) {
    const double h = 5e-6;
    double turned = 0.0;
    for (double t = 0.0; t < end_s - 0.5 * h; t += h) {
      const double before = std::atan2(k[1], k[0]);
      step(h);
      turned += std::remainder(std::atan2(k[1], k[0]) - before, 2 * M_PI);
    }
    return std::abs(turned);
  }
};

TEST(Rolling, SteadyPrecessionOfThinDisc) {
  // A disc without thickness that leans by a and rolls about a fixed centre turns about the vertical at sqrt(4 g/(r sin a)): H. K. Moffatt,
  // "Euler's disk and its finite-time singularity", Nature 404 (2000), eq. 2. The resistance lowers it by 1 to 3 mm in this time.
  for (const double degrees : {14.0, 30.0}) {
    const double radius = 0.075, a = degrees * M_PI / 180, s = std::sin(a), c = std::cos(a),
                 rate = std::sqrt(4.0 * kGravity / (radius * s));
    const Vec3 spin{0, rate * s * c, rate * s * s};
    const Precession found = precess(radius, 0.002, a, rate, spin, 1.0);
    RollingDisc disc{radius, 0.001, {0, -s, c}, spin};
    const double turned = disc.roll(1.0) / rate;
    EXPECT_NEAR(found.turned / turned, 1.0, 0.01) << degrees << " degrees";
    EXPECT_NEAR(found.lowest_m / -disc.find_touch(disc.k)[2], 1.0, 0.01) << degrees << " degrees";
  }
}

TEST(Rolling, SteadyPrecessionOfCoin) {
  // The same with a thickness of 2 e. The centre rests, so that the spin is along the way p = r d - e k from it to the rim (k the axis, d
  // down the slope): w = -W sin a (d - e/r k). Its momentum A (w - (w k) k) + C (w k) k turns with W about the vertical, which p x m g
  // does:
  //   W^2 sin a (A cos a - C e/r sin a) = m g (r cos a - e sin a).
  const double radius = 0.012, e = 0.001, thickness = 2.0 * e;
  for (const double degrees : {8.0, 14.0, 30.0}) {
    const double a = degrees * M_PI / 180, s = std::sin(a), c = std::cos(a);
    const double across = radius * radius / 4.0 + thickness * thickness / 12.0, along = radius * radius / 2.0;  // of 1 kg
    const double rate = std::sqrt(kGravity * (radius * c - e * s) / (s * (across * c - along * e / radius * s)));
    const Vec3 k{0, -s, c}, d{0, -c, -s}, spin = -rate * s * (d - (e / radius) * k);
    const Precession found = precess(radius, thickness, a, rate, spin, 0.3);
    RollingDisc coin{radius, e, k, spin};
    const double turned = coin.roll(0.3) / (0.3 * rate);
    EXPECT_NEAR(found.turned / turned, 1.0, 0.01) << degrees << " degrees";
    EXPECT_NEAR(found.lowest_m / -coin.find_touch(coin.k)[2], 1.0, 0.01) << degrees << " degrees";
  }
}

TEST(Rolling, DurationOfEulersDisc) {
  // At small angles E = 3/2 m g r a and W = 2 sqrt(g/(r a)); the resistance takes c m g r W a second, so that the disc lies after
  // a^(3/2) / (2 c sqrt(g/r)).
  const double radius = 0.0375, a = 0.2, ends = 0.02, s = std::sin(a), c = std::cos(a), rate = std::sqrt(4.0 * kGravity / (radius * s));
  const bank::Bank disc = make_bank(geometry::tests::make_cylinder(radius, 0.006, 96));
  WorldSpec w;
  w.ground = GroundSpec{.friction = 0.8};
  w.bodies = {make_body(disc, {0, 0, radius * s + 0.003 * c}, 0.8)};
  w.bodies[0].initial.rotation = {std::cos(a / 2), std::sin(a / 2), 0, 0};
  w.bodies[0].angular_velocity_rad_s = {0, rate * s * c, rate * s * s};
  double leans_s = 0.0;
  const auto path = run(w, 3.5)[0];
  for (const auto& m : path)
    if (rotate(m.rotation, {0, 0, 1})[2] < std::cos(ends)) leans_s = m.time_s;
  const double expected_s = (std::pow(a, 1.5) - std::pow(ends, 1.5)) / (2.0 * kRollingResistance * std::sqrt(kGravity / radius));
  EXPECT_NEAR(leans_s / expected_s, 1.0, 0.03);
}

/// Bottom, wall of 3 mm, shoulder and neck.
geometry::tests::Solid make_bottle(double radius, int around) {
  std::vector<std::array<double, 2>> outline{{0, 0}, {radius, 0}}, inside;
  const auto find_radius = [&](double z) {
    const double s = std::clamp((z - 0.14) / 0.05, 0.0, 1.0);
    return 0.013 + (radius - 0.013) * 0.5 * (1.0 + std::cos(M_PI * s));
  };
  for (int i = 1; i <= 48; ++i) outline.push_back({find_radius(0.005 * i), 0.005 * i});
  for (int i = 48; i >= 1; --i) inside.push_back({find_radius(0.005 * i) - 0.003, 0.005 * i});
  outline.insert(outline.end(), inside.begin(), inside.end());
  outline.push_back({0, 0.005});
  return geometry::tests::make_lathe(outline, around, false);
}

class RollingBottle : public testing::TestWithParam<std::tuple<double, int>> {};
INSTANTIATE_TEST_SUITE_P(Planes, RollingBottle, testing::Combine(testing::Values(3.0, 10.0), testing::Values(24, 48)));  // degrees; facets

TEST_P(RollingBottle, AccelerationOfRoundBottle) {
  // g (sin a - c cos a)/(1 + I/(m r^2)). A full one is a cylinder, an empty one has a bottom, a wall and a neck.
  const auto [degrees, facets] = GetParam();
  const double a = degrees * M_PI / 180, radius = 0.035;
  const bank::Bank plane = make_box({4.0, 0.6, 0.04});
  const geometry::tests::Solid full = geometry::tests::make_cylinder(radius, 0.2, facets), empty = make_bottle(radius, facets);
  for (const auto* solid : {&full, &empty}) {
    const bank::Bank bottle = make_bank(*solid);
    const double mass = bottle.rigid.mass_kg, inertia = bottle.rigid.inertia_kg_m2[8];
    WorldSpec w;
    w.bodies = {make_body(bottle, {}, 0.5), make_body(plane, {}, 0.5)};
    w.bodies[1].fixed = true;
    w.bodies[1].initial.rotation = {std::cos(a / 2), 0, std::sin(a / 2), 0};
    const Vec3 down{std::cos(a), 0, -std::sin(a)}, up{std::sin(a), 0, std::cos(a)};
    // On its side: its axis across the slope.
    const double q = std::sqrt(0.5);
    w.bodies[0].initial.rotation = {q * std::cos(a / 2), -q * std::cos(a / 2), q * std::sin(a / 2), q * std::sin(a / 2)};
    w.bodies[0].initial.position_m =
        (radius + 0.02) * up - 1.9 * down - rotate(w.bodies[0].initial.rotation, {0, 0, bottle.rigid.centre_m[2]});
    const auto path = run(w, 1.1)[0];
    const auto speed = [&](double t) {
      const Vec3& v = get_at(path, t).velocity_m_s;
      return v[0] * down[0] + v[2] * down[2];
    };
    const double expected = kGravity * (std::sin(a) - kRollingResistance * std::cos(a)) / (1.0 + inertia / (mass * radius * radius));
    EXPECT_NEAR((speed(1.0) - speed(0.1)) / (0.9 * expected), 1.0, 0.02) << (solid == &full ? "full" : "empty");
  }
}

}  // namespace
}  // namespace carillon::physics::tests
