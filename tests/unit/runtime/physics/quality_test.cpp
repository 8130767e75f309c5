// Hits of contacts: complete and without false ones, down to inaudible speeds.
#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <utility>
#include <variant>

#include "tests/unit/runtime/physics/checks.hpp"
#include "tests/unit/runtime/physics/solids.hpp"

namespace carillon::physics::tests {
namespace {

constexpr double kGravity = 9.81;
constexpr double kSlowestHit = 1e-3;  // m/s; docs/decisions/contact.md

BodySpec make_body(const bank::Bank& bank, Vec3 position, double restitution) {
  BodySpec b;
  b.name = "body";
  b.bank = &bank;
  b.initial.position_m = position;
  b.restitution = restitution;
  return b;
}

WorldSpec make_ground_world(const BodySpec& body) {
  WorldSpec w;
  w.ground = GroundSpec{};
  w.ground->restitution = body.restitution;
  w.bodies = {body};
  return w;
}

struct Hit {
  double time_s = 0.0, speed_m_s = 0.0;
  bool bounces = true;
};

/// Hertz time of a ball on the ground: Johnson (1985) 11.24.
double calc_hertz(const bank::Bank& ball, double radius_m, double speed_m_s) {
  const GroundSpec ground;
  const double compliance = (1 - std::pow(ball.material.poisson_ratio, 2)) / ball.material.young_modulus_pa +
                            (1 - std::pow(ground.poisson_ratio, 2)) / ground.young_modulus_pa;
  return 2.87 * std::pow(std::pow(ball.rigid.mass_kg * compliance, 2) / (radius_m * speed_m_s), 0.2);
}

/// Of a point mass that falls and bounces: t_0 = sqrt(2 h / g), v_n = e^n v_0, t_n+1 = t_n + 2 v_n+1 / g; as long as it stays in the air
/// for longer than `share` times the Hertz time, and then once more without a bounce.
std::vector<Hit> list_bounces(const bank::Bank& ball, double radius_m, double height_m, double restitution, double share = 1.0) {
  std::vector<Hit> hits;
  Hit hit{std::sqrt(2 * height_m / kGravity), std::sqrt(2 * height_m * kGravity)};
  while (hit.bounces && hit.speed_m_s > share * kSlowestHit) {
    const double flight = 2 * restitution * hit.speed_m_s / kGravity;
    hit.bounces = flight > share * calc_hertz(ball, radius_m, hit.speed_m_s);
    hits.push_back(hit);
    hit.speed_m_s *= restitution;
    hit.time_s += flight;
  }
  return hits;
}

double get_touch_s(const Impulse& p) { return p.time_s - 0.5 * p.duration_s; }

class Bouncing : public testing::TestWithParam<std::tuple<double, double, double>> {};
/// radius, height, restitution
INSTANTIATE_TEST_SUITE_P(Balls, Bouncing,
                         testing::Values(std::tuple{0.03, 0.2, 0.3}, std::tuple{0.03, 0.2, 0.5}, std::tuple{0.02, 0.05, 0.7},
                                         std::tuple{0.05, 0.02, 0.9}, std::tuple{0.03, 5e-4, 0.5}, std::tuple{0.01, 1e-5, 0.5},
                                         std::tuple{0.003, 5e-4, 0.6}));

TEST_P(Bouncing, HitTimesOfClosedForm) {
  const auto [radius, height, e] = GetParam();
  bank::Bank ball = make_ball(radius, 5);
  if (radius < 0.02)
    ball.material.young_modulus_pa = 2e11;  // a hard one: its contacts are short, and it hops on down to millimetres a second
  const std::vector<Hit> expected = list_bounces(ball, radius, height, e);
  const Simulation s = simulate(make_ground_world(make_body(ball, {0, 0, radius + height}, e)), expected.back().time_s + 0.3);
  // Where flight and contact are about as long, one more or less is as good.
  const std::size_t fewest = list_bounces(ball, radius, height, e, 1.1).size(), max = list_bounces(ball, radius, height, e, 0.9).size();
  ASSERT_GE(s.impulses.size(), fewest) << "a hit is missing";
  EXPECT_LE(s.impulses.size(), max) << "a machine-gun";
  EXPECT_GE(fewest, height > 1e-4 ? 2U : 1U);
  for (std::size_t n = 0; n < std::min(s.impulses.size(), expected.size()); ++n) {
    const Hit& hit = expected[n];
    EXPECT_NEAR(get_touch_s(s.impulses[n]), hit.time_s, 2e-5 + 1e-3 * hit.time_s) << "hit " << n;
    if (n + 1 >= fewest) continue;
    EXPECT_NEAR(s.impulses[n].impulse_n_s[2] / ball.rigid.mass_kg, (1 + e) * hit.speed_m_s, 0.01 * hit.speed_m_s + 2e-4) << "hit " << n;
  }
  // The hits return the momentum of gravity over the whole time, except for the last moment.
  double given = 0.0;
  for (const Impulse& p : s.impulses) given += p.impulse_n_s[2] / ball.rigid.mass_kg;
  const Impulse& last = s.impulses.back();
  EXPECT_NEAR(given, kGravity * get_touch_s(last), 0.01 * given + 1.1 * expected.back().speed_m_s * e) << "down to the speed that is left";
}

TEST(Bouncing, SameHitsWithSidewaysDrift) {
  // Without friction the way along the ground changes nothing: no hit is taken for the hop of a mesh that rolls.
  const bank::Bank ball = make_ball(0.03, 4);
  for (const double height : {5e-4, 5e-3}) {
    WorldSpec w = make_ground_world(make_body(ball, {0, 0, 0.03 + height}, 0.7));
    w.ground->friction = w.bodies[0].friction = 0.0;
    const Simulation down = simulate(w, 0.5);
    for (const double speed : {0.05, 0.2, 1.0}) {
      w.bodies[0].velocity_m_s = {speed, 0.3 * speed, 0};
      const Simulation sideways = simulate(w, 0.5);
      ASSERT_EQ(sideways.impulses.size(), down.impulses.size()) << speed << " m/s, from " << height;
      for (std::size_t n = 0; n < down.impulses.size(); ++n) {
        EXPECT_NEAR(sideways.impulses[n].time_s, down.impulses[n].time_s, 1e-4);
        EXPECT_NEAR(sideways.impulses[n].impulse_n_s[2], down.impulses[n].impulse_n_s[2], 0.02 * down.impulses[0].impulse_n_s[2]);
      }
    }
  }
}

TEST(SlowHit, AudibleHitOfDriftingBody) {
  // Without gravity nothing but the hit can come of it: 2 mm/s, a snail's pace.
  const bank::Bank ball = make_ball(0.03, 3), plate = make_box({0.2, 0.2, 0.02});
  WorldSpec w;
  w.gravity_m_s2 = {0, 0, 0};
  w.bodies = {make_body(ball, {0, 0, 0.0405}, 0.5), make_body(plate, {0, 0, 0}, 0.5)};
  w.bodies[0].velocity_m_s = {0, 0, -0.002};
  w.bodies[1].fixed = true;
  const Simulation s = simulate(w, 0.6);
  ASSERT_EQ(s.impulses.size(), 2U);
  EXPECT_NEAR(get_touch_s(s.impulses[0]), 0.0005 / 0.002, 1e-3);
  EXPECT_NEAR(s.impulses[0].impulse_n_s[2], 1.5 * ball.rigid.mass_kg * 0.002, 0.02 * ball.rigid.mass_kg * 0.002);
}

class ComingToRest : public testing::TestWithParam<double> {};
INSTANTIATE_TEST_SUITE_P(Restitutions, ComingToRest, testing::Values(0.0, 0.3, 0.6));

TEST_P(ComingToRest, NoRapidRepeatedHits) {
  // A box that falls on a corner rattles to rest with ever shorter flights. No corner hits again before the end of its contact, except for
  // a tenth of a hit caused by the landing of another corner, and the sum of all hits is the momentum of gravity.
  const double e = GetParam();
  const bank::Bank box = make_box({0.06, 0.05, 0.04});
  for (int turn = 0; turn < 12; ++turn) {
    WorldSpec w = make_ground_world(make_body(box, {0, 0, 0.08}, e));
    w.bodies[0].initial.rotation = {0.9, 0.3 * std::cos(turn), 0.25 * std::sin(turn), 0.1};
    const Simulation s = simulate(w, 2.5);
    ASSERT_GE(s.impulses.size(), 3U);
    EXPECT_LE(s.impulses.size(), 90U) << "turn " << turn;
    EXPECT_LT(s.impulses.back().time_s, 1.2) << "it rattles on";
    double pushed = 0.0, loudest = 0.0;
    std::map<std::array<int, 3>, std::pair<double, double>> last;  // of each corner: touch and end of its contact
    for (const Impulse& p : s.impulses) {
      const Vec3 x = point_on_body(box, p);
      const std::array<int, 3> corner{x[0] > 0, x[1] > 0, x[2] > 0};
      const double touch = get_touch_s(p), push = impulse_in_world(s, p)[2];
      loudest = std::max(loudest, push);
      const auto before = last.find(corner);
      if (before != last.end() && touch < before->second.second) {
        EXPECT_LT(push, 0.1 * loudest) << "turn " << turn << ", again after " << touch - before->second.first << " s at " << touch;
      }
      last[corner] = {touch, touch + p.duration_s};
      pushed += push;
    }
    EXPECT_LE(pushed, box.rigid.mass_kg * kGravity * (s.impulses.back().time_s + 0.01));
  }
}

/// Where a block that slides at 1 m/s over a floor of friction 0.4 has stopped, and in how many steps.
std::pair<double, std::int64_t> slide(double contact_step_s) {
  const bank::Bank box = make_box({0.08, 0.06, 0.02});
  WorldSpec w = make_ground_world(make_body(box, {0, 0, 0.01}, 0.3));
  w.ground->friction = w.bodies[0].friction = 0.4;
  w.bodies[0].velocity_m_s = {1, 0, 0};
  World world(w, {.contact_step_s = contact_step_s, .end_s = 0.5});
  double x = 0.0;
  world.advance(0.5, 1e9, [&](const events::Event& event) {
    if (const auto* motion = std::get_if<events::BodyMotion>(&event)) x = motion->position_m[0];
  });
  return {x, world.get_statistics().steps};
}

TEST(ContactStep, StepOfOptionsAndItsCost) {
  const auto [coarse_m, coarse_steps] = slide(1e-3);
  const auto [fine_m, fine_steps] = slide(1e-4);
  const double stops_m = 1.0 / (2 * 0.4 * kGravity);
  EXPECT_NEAR(coarse_m, stops_m, 0.02 * stops_m);
  EXPECT_NEAR(fine_m, stops_m, 0.01 * stops_m);
  EXPECT_GT(fine_steps, 5 * coarse_steps);
  for (const double step : {0.0, -1e-4, 1e-7, 0.01, std::nan("")}) EXPECT_THROW(slide(step), InputError) << step;
}

}  // namespace
}  // namespace carillon::physics::tests
