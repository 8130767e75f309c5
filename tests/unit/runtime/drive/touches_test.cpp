// Events of hand-written steps: against the impulses and weights that were put in.
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>
#include <set>

#include "runtime/base/error.hpp"
#include "tests/unit/runtime/drive/touch_rig.hpp"

namespace carillon::drive::tests {
namespace {

using physics::tests::make_ball;
using physics::tests::make_box;

constexpr double kRadius = 0.03;

/// A ball that falls on the ground at 1 m/s and leaves it at 0.5 m/s, in equal shares of `steps` steps.
Rig& strike_in_steps(Rig& rig, const bank::Bank& ball, int steps, double dt_s) {
  rig.add(ball, "ball", {0, 0, kRadius}, {0, 0, -1.0});
  rig.start();
  const double mass = ball.rigid.mass_kg;
  for (int n = 0; n < steps; ++n) {
    const double force = 1.0 / steps;
    rig.poses[0].velocity_m_s[2] += 1.5 * force;
    rig.step(dt_s, {on_ground(0, {}, mass * (1.5 * force + kGravity * dt_s))});
  }
  for (int n = 0; n < 40; ++n) rig.step(dt_s, {});
  return rig;
}

TEST(Touches, OneHitInAnyNumberOfStepsIsOnePulse) {
  const bank::Bank ball = make_ball(kRadius);
  const double wanted = 1.5 * ball.rigid.mass_kg;
  double duration = 0.0;
  for (const int steps : {1, 2, 17}) {
    Rig rig({.compliant = steps > 2});
    strike_in_steps(rig, ball, steps, 1e-3 / steps);
    const auto pulses = rig.list<events::Impulse>();
    ASSERT_EQ(pulses.size(), 1U) << steps;
    EXPECT_NEAR(pulses[0].impulse_n_s[2], wanted, 0.02 * wanted) << steps;
    if (duration == 0.0) duration = pulses[0].duration_s;
    EXPECT_NEAR(pulses[0].duration_s, duration, 0.02 * duration) << steps;
    EXPECT_NEAR(pulses[0].time_s - 0.5 * pulses[0].duration_s, 0.0, 1e-6) << "touches when the steps begin";
    EXPECT_TRUE(rig.faults.empty());
  }
}

/// An ideal spring of half a period of 1 ms sends the ball back with its speed, in up to 10,000 steps.
TEST(Touches, SpringContactsInStepsDownTo100Ns) {
  const bank::Bank ball = make_ball(kRadius);
  const double period = 1e-3, omega = M_PI / period, mass = ball.rigid.mass_kg;
  for (const double dt : {1e-5, 1e-6, 1e-7})
    for (const bool is_after : {false, true}) {
      Rig rig({.points_after = is_after, .compliant = true, .gravity_m_s2 = {}});
      rig.add(ball, "ball", {0, 0, kRadius}, {0, 0, -1.0});
      rig.start();
      double depth = 0.0;
      const int steps = static_cast<int>(std::lround(period / dt));
      for (int n = 1; n <= steps; ++n) {
        const double before = depth, speed = -std::cos(omega * n * dt);
        depth = std::sin(omega * n * dt) / omega;
        TouchPoint point = on_ground(0, {}, mass * (speed - rig.poses[0].velocity_m_s[2]));
        point.gap_m = is_after ? -depth : -before;
        rig.poses[0].velocity_m_s[2] = speed;
        rig.poses[0].position_m[2] = kRadius - depth;
        rig.step(dt, {point});
      }
      for (int n = 0; n < 20; ++n) rig.step(1e-3, {});
      ASSERT_EQ(rig.list<events::Impulse>().size(), 1U) << dt << is_after;
      EXPECT_NEAR(rig.sum_impulses(0)[2], 2.0 * mass, 2e-3 * 2.0 * mass) << dt << is_after;
      EXPECT_TRUE(rig.faults.empty());
    }
}

TEST(Touches, HitsInsideAStepBeginAtTheTouchWithItsSpeed) {
  // The ball falls 8 mm and bounces, all within one step, as in sums over the internal steps of an engine.
  const bank::Bank ball = make_ball(kRadius);
  const double dt = 1.0 / 60.0, height = 8e-3, speed = 0.6;
  const double touch = std::sqrt(speed * speed + 2.0 * kGravity * height), wait = (touch - speed) / kGravity;
  Rig rig({.points_after = true, .compliant = true});
  rig.add(ball, "ball", {0, 0, kRadius + height}, {0, 0, -speed});
  rig.start();
  rig.poses[0].velocity_m_s[2] = 0.5 * touch - kGravity * (dt - wait);
  rig.poses[0].position_m[2] = kRadius + (dt - wait) * (0.5 * touch - 0.5 * kGravity * (dt - wait));
  TouchPoint point = on_ground(0, {}, 1.5 * touch * ball.rigid.mass_kg);
  point.gap_m = rig.poses[0].position_m[2] - kRadius;
  rig.step(dt, {point});
  rig.step(dt, {});
  const auto pulses = rig.list<events::Impulse>();
  ASSERT_EQ(pulses.size(), 1U);
  EXPECT_NEAR(pulses[0].time_s - 0.5 * pulses[0].duration_s, wait, 1e-6);
  EXPECT_NEAR(pulses[0].impulse_n_s[2], 1.5 * touch * ball.rigid.mass_kg, 1e-9);
}

TEST(Touches, EarlyHitsAreReportedInTheirFirstStep) {
  const bank::Bank ball = make_ball(kRadius);
  Rig rig({.compliant = true, .early = true});
  rig.add(ball, "ball", {0, 0, kRadius}, {0, 0, -1.0});
  rig.start();
  rig.poses[0].velocity_m_s[2] = -0.9;
  rig.step(1e-4, {on_ground(0, {}, 0.1 * ball.rigid.mass_kg)});
  ASSERT_EQ(rig.list<events::Impulse>().size(), 1U);
  EXPECT_NEAR(rig.sum_impulses(0)[2], 1.5 * ball.rigid.mass_kg, 1e-6);
  rig.poses[0].velocity_m_s[2] = 0.5;
  rig.step(1e-4, {on_ground(0, {}, 1.4 * ball.rigid.mass_kg)});
  for (int n = 0; n < 9; ++n) rig.step(1e-4, {});
  EXPECT_EQ(rig.list<events::Impulse>().size(), 1U) << "reported once";
}

TEST(Touches, RestitutionDoesNotDependOnTheTurnWithinAStep) {
  const bank::Bank box = make_box({0.1, 0.08, 0.04});
  const Vec3 arm{0.05, 0.0, -0.02};  // an edge strikes; 1/m_eff = 1/m + x^2 / I
  const double inertia = box.rigid.inertia_kg_m2[4];
  const double impulse = 1.5 / (1.0 / box.rigid.mass_kg + arm[0] * arm[0] / inertia), spin = -arm[0] * impulse / inertia;
  std::vector<double> durations;
  for (const double dt : {1e-4, 1.0 / 60.0}) {
    Rig rig({.gravity_m_s2 = {}});
    rig.add(box, "box", {0, 0, 0.02}, {0, 0, -1.0});
    rig.start();
    auto& pose = rig.poses[0];
    pose.velocity_m_s[2] += impulse / box.rigid.mass_kg;
    pose.spin_rad_s = {0, spin, 0};
    pose.position_m[2] += dt * pose.velocity_m_s[2];
    pose.rotation = {std::cos(0.5 * spin * dt), 0, std::sin(0.5 * spin * dt), 0};
    rig.step(dt, {on_ground(0, {arm[0], 0, 0}, impulse)});
    rig.step(dt, {});
    const auto pulses = rig.list<events::Impulse>();
    ASSERT_EQ(pulses.size(), 1U);
    durations.push_back(pulses[0].duration_s);
  }
  EXPECT_NEAR(durations[1], durations[0], 1e-3 * durations[0]);
}

TEST(Touches, BouncesAreNoLastingContacts) {
  const bank::Bank ball = make_ball(kRadius);
  for (const double rate : {60.0, 240.0, 1000.0}) {
    Rig rig;
    strike_in_steps(rig, ball, 1, 1.0 / rate);
    EXPECT_TRUE(rig.has_hits());
    EXPECT_TRUE(rig.list<events::LastingContact>().empty()) << rate;
  }
}

TEST(Touches, WeightAloneIsNoHit) {
  const Vec3 half{0.05, 0.04, 0.02};
  const bank::Bank box = make_box({0.1, 0.08, 0.04});
  const double weight = box.rigid.mass_kg * kGravity;
  for (const double rate : {60.0, 240.0, 1000.0, 10000.0}) {
    Rig rig;
    rig.add(box, "box", {0, 0, 0.02});
    rig.start();
    for (int n = 0; n < std::max(20.0, 0.1 * rate); ++n) rig.step(1.0 / rate, on_four_corners(0, {}, half, weight / rate));
    EXPECT_FALSE(rig.has_hits()) << rate;
    std::map<std::uint64_t, double> forces;
    for (const auto& c : rig.list<events::LastingContact>()) forces[c.id] = c.force_n;
    EXPECT_EQ(forces.size(), 4U) << rate;
    double sum = 0.0;
    for (const auto& [id, force] : forces) sum += force;
    EXPECT_NEAR(sum, weight, 0.03 * weight) << rate;
    EXPECT_TRUE(rig.faults.empty()) << rig.faults.front();
  }
}

TEST(Touches, NewContactsCarryTheirWeightAtOnce) {
  const bank::Bank box = make_box({0.1, 0.08, 0.04});
  const double weight = box.rigid.mass_kg * kGravity, dt = 1.0 / 60.0;
  Rig rig;
  rig.add(box, "box", {0, 0, 0.02});
  rig.start();
  for (int n = 0; n < 3; ++n) rig.step(dt, on_four_corners(0, {}, {0.05, 0.04, 0.02}, weight * dt));
  for (const auto& c : rig.list<events::LastingContact>())
    EXPECT_NEAR(c.force_n, c.time_s > 2.5 * dt ? 0.25 * weight : 0.0, 0.01 * weight) << c.time_s;
  EXPECT_EQ(rig.list<events::LastingContact>().size(), 8U);
}

TEST(Touches, LoadThatHopsIsTwoConstantContacts) {
  const bank::Bank box = make_box({0.1, 0.08, 0.04});
  const double weight = box.rigid.mass_kg * kGravity;
  for (const double rate : {60.0, 240.0, 1000.0}) {
    Rig rig;
    rig.add(box, "box", {0, 0, 0.02});
    rig.start();
    for (int n = 0; n < rate; ++n) rig.step(1.0 / rate, {on_ground(0, {n % 2 == 0 ? 0.05 : -0.05, 0, 0}, weight / rate)});
    EXPECT_FALSE(rig.has_hits()) << rate;
    std::set<std::uint64_t> ids;
    for (const auto& c : rig.list<events::LastingContact>()) {
      ids.insert(c.id);
      EXPECT_NE(c.state, events::ContactState::kEnd) << rate;
      if (c.time_s > 0.5) {
        EXPECT_NEAR(c.force_n, 0.5 * weight, 0.15 * weight) << rate;
      }
    }
    EXPECT_EQ(ids.size(), 2U) << rate;
  }
}

/// Boxes on the ground and on each other, struck now and then. `order`: of the bodies; `seed`: shuffles the points of each step.
std::vector<events::Event> play_stack(const bank::Bank& box, const std::vector<int>& order, unsigned seed) {
  Rig rig;
  std::vector<int> index(3);
  for (const int k : order) index[k] = rig.add(box, std::string(1, static_cast<char>('a' + k)), {0, 0, 0.02 + 0.04 * k});
  rig.start();
  std::mt19937 chance(seed);
  const double weight = box.rigid.mass_kg * kGravity, dt = 1.0 / 500.0;
  for (int n = 0; n < 100; ++n) {
    const bool is_struck = n % 25 == 20;
    std::vector<TouchPoint> points;
    for (int k = 0; k < 3; ++k) {
      rig.poses[index[k]].velocity_m_s[2] = n % 25 == 19 ? -0.2 : 0.0;
      for (TouchPoint p : on_four_corners(index[k], {}, {0.05, 0.04, 0.02}, (3 - k) * weight * dt + (is_struck ? 0.5 * (k + 1) : 0.0))) {
        p.point_m[2] = 0.04 * k;
        if (k > 0) p.b = index[k - 1];
        if (p.b > p.a) {  // as an engine that orders bodies by number
          std::swap(p.a, p.b);
          p.normal = -1.0 * p.normal;
        }
        points.push_back(p);
      }
    }
    if (seed != 0) std::shuffle(points.begin(), points.end(), chance);
    rig.step(dt, points);
  }
  EXPECT_TRUE(rig.faults.empty());
  EXPECT_TRUE(rig.has_hits());
  std::vector<int> number(3);
  for (int k = 0; k < 3; ++k) number[index[k]] = k;
  std::vector<events::Event> all = rig.events;
  for (events::Event& event : all)
    std::visit(
        [&](auto& e) {
          if constexpr (requires { e.body; }) e.body = number[e.body];
          if constexpr (requires { e.other; }) e.other = e.other < 0 ? -1 : number[e.other];
        },
        event);
  return all;
}

/// One line per event, sorted.
std::multiset<std::string> describe(const std::vector<events::Event>& events) {
  std::multiset<std::string> lines;
  for (const events::Event& event : events) {
    std::string line = std::to_string(event.index()) + " " + std::to_string(events::get_time_s(event));
    const auto add = [&](double x) {
      char text[40];
      std::snprintf(text, sizeof text, " %.17g", x);
      line += text;
    };
    std::visit(
        [&](const auto& e) {
          if constexpr (requires { e.body; }) line += " " + std::to_string(e.body);
          if constexpr (requires { e.other; }) line += " " + std::to_string(e.other) + " " + std::to_string(e.triangle);
          if constexpr (requires { e.id; }) line += " " + std::to_string(e.id);
          if constexpr (requires { e.force_n; }) add(e.force_n);
          if constexpr (requires { e.duration_s; })
            for (const double x : e.impulse_n_s) add(x);
        },
        event);
    lines.insert(line);
  }
  return lines;
}

TEST(Touches, OrderOfPointsAndBodiesChangesNothing) {
  const bank::Bank box = make_box({0.1, 0.08, 0.04});
  const auto wanted = describe(play_stack(box, {0, 1, 2}, 0));
  EXPECT_EQ(wanted, describe(play_stack(box, {0, 1, 2}, 1))) << "points";
  EXPECT_EQ(wanted, describe(play_stack(box, {2, 0, 1}, 2))) << "bodies";
}

TEST(Touches, StepsOfAnyLength) {
  const bank::Bank ball = make_ball(kRadius);
  Rig rig;
  const double given = bounce_in_random_steps(rig, ball, kRadius, 5);
  EXPECT_TRUE(rig.faults.empty()) << rig.faults.front();
  EXPECT_GE(rig.touches.get_counters().hits, 2);
  EXPECT_NEAR(rig.sum_impulses(0)[2], given, 0.05 * given);
}

TEST(Touches, RecoveryFromOverlapIsNoHit) {
  const bank::Bank box = make_box({0.1, 0.08, 0.04});
  Rig rig;
  rig.add(box, "box", {0, 0, 0.0});
  rig.start();
  for (int n = 0; n < 5; ++n) {
    rig.poses[0].velocity_m_s[2] = 1.0;
    rig.poses[0].position_m[2] += 1.0 / 240.0;
    rig.step(1.0 / 240.0, on_four_corners(0, {}, {0.05, 0.04, 0.02}, n == 0 ? box.rigid.mass_kg : 0.0));
  }
  EXPECT_FALSE(rig.has_hits());
}

TEST(Touches, TeleportEndsContactsAndCutsThePath) {
  const bank::Bank box = make_box({0.1, 0.08, 0.04});
  const double dt = 1.0 / 240.0, weight = box.rigid.mass_kg * kGravity;
  for (const bool is_reported : {true, false}) {
    Rig rig;
    rig.add(box, "box", {0, 0, 0.02});
    rig.start();
    for (int n = 0; n < 20; ++n) rig.step(dt, on_four_corners(0, {}, {0.05, 0.04, 0.02}, weight * dt));
    rig.poses[0].position_m[0] = 3.0;
    rig.poses[0].teleported = is_reported;
    rig.step(dt, on_four_corners(0, {3.0, 0, 0}, {0.05, 0.04, 0.02}, weight * dt));
    const auto motions = rig.list<events::BodyMotion>();
    EXPECT_EQ(motions.back().cut, is_reported);
    EXPECT_EQ(motions.back().position_m[0], 3.0);
    rig.poses[0].teleported = false;
    for (int n = 0; n < 20; ++n) rig.step(dt, on_four_corners(0, {3.0, 0, 0}, {0.05, 0.04, 0.02}, weight * dt));
    EXPECT_FALSE(rig.has_hits()) << is_reported;
    EXPECT_EQ(rig.touches.get_counters().teleports, is_reported ? 1 : 0);
    std::set<std::uint64_t> open;
    for (const auto& c : rig.list<events::LastingContact>()) {
      if (c.state == events::ContactState::kEnd)
        open.erase(c.id);
      else
        open.insert(c.id);
    }
    EXPECT_EQ(open.size(), 4U) << "of the new place";
    EXPECT_TRUE(rig.faults.empty());
  }
}

TEST(Touches, SleepIsOneRecord) {
  const bank::Bank box = make_box({0.1, 0.08, 0.04});
  const double dt = 1.0 / 240.0, weight = box.rigid.mass_kg * kGravity;
  Rig rig;
  rig.add(box, "box", {0, 0, 0.02});
  rig.start();
  const auto points = on_four_corners(0, {}, {0.05, 0.04, 0.02}, weight * dt);
  for (int n = 0; n < 40; ++n) rig.step(dt, points);
  rig.events.clear();
  rig.poses[0].asleep = true;
  for (int n = 0; n < 100; ++n) rig.step(dt, {});
  std::set<std::uint64_t> ids;
  for (const auto& c : rig.list<events::LastingContact>()) {
    EXPECT_TRUE(ids.insert(c.id).second) << "once";
    EXPECT_NEAR(c.force_n, 0.25 * weight, 0.02 * weight);
    EXPECT_EQ(c.state, events::ContactState::kHold);
  }
  EXPECT_EQ(ids.size(), 4U);
  rig.events.clear();
  rig.poses[0].asleep = false;
  for (int n = 0; n < 20; ++n) rig.step(dt, points);
  for (const auto& c : rig.list<events::LastingContact>()) EXPECT_TRUE(ids.contains(c.id)) << "the same contacts";
  EXPECT_FALSE(rig.has_hits());
}

TEST(Touches, ImpulsesAreFoundFromVelocities) {
  const bank::Bank ball = make_ball(kRadius), box = make_box({0.1, 0.08, 0.04});
  constexpr double kUnknown = TouchPoint::kUnknown;
  Rig rig;
  rig.add(ball, "ball", {0, 0, kRadius}, {0, 0, -1.0});
  rig.add(box, "box", {1, 0, 0.02});
  rig.start();
  const double dt = 1.0 / 240.0;
  auto points = on_four_corners(1, {1, 0, 0}, {0.05, 0.04, 0.02}, kUnknown);
  points.push_back(on_ground(0, {}, kUnknown));
  for (TouchPoint& p : points) p.friction_n_s = {kUnknown, kUnknown, kUnknown};
  rig.poses[0].velocity_m_s[2] = 0.5;
  rig.step(dt, points);
  points.pop_back();
  for (int n = 0; n < 40; ++n) {
    rig.poses[0].velocity_m_s[2] -= kGravity * dt;
    rig.step(dt, points);
  }
  EXPECT_NEAR(rig.sum_impulses(0)[2], 1.5 * ball.rigid.mass_kg, 0.01 * ball.rigid.mass_kg);
  double sum = 0.0;
  std::map<std::uint64_t, double> forces;
  for (const auto& c : rig.list<events::LastingContact>()) forces[c.id] = c.force_n;
  for (const auto& [id, force] : forces) sum += force;
  EXPECT_NEAR(sum, box.rigid.mass_kg * kGravity, 0.02 * box.rigid.mass_kg * kGravity);
}

TEST(Touches, SlidingAndRolling) {
  const bank::Bank ball = make_ball(kRadius), box = make_box({0.1, 0.08, 0.04});
  for (const auto& [rate, is_after] : {std::pair(60.0, false), {240.0, false}, {1000.0, false}, {60.0, true}, {240.0, true}}) {
    Rig rig({.points_after = is_after});
    rig.add(ball, "ball", {0, 0, kRadius}, {0.5, 0, 0});
    rig.add(box, "box", {0, 1, 0.02}, {0.8, 0, 0});
    rig.poses[0].spin_rad_s = {0, 0.5 / kRadius, 0};
    rig.start();
    const double dt = 1.0 / rate;
    for (int n = 0; n < 0.5 * rate; ++n) {
      const auto find_points = [&] {
        auto points = on_four_corners(1, rig.poses[1].position_m, {0.05, 0.04, 0.02}, box.rigid.mass_kg * kGravity * dt);
        points.push_back(on_ground(0, {rig.poses[0].position_m[0], 0, 0}, ball.rigid.mass_kg * kGravity * dt));
        return points;
      };
      const auto before = find_points();
      rig.poses[0].position_m[0] += 0.5 * dt;
      rig.poses[1].position_m[0] += 0.8 * dt;
      const double half = 0.25 / kRadius * (rig.time_s + dt);
      rig.poses[0].rotation = {std::cos(half), 0, std::sin(half), 0};
      rig.step(dt, is_after ? find_points() : before);
    }
    EXPECT_FALSE(rig.has_hits());
    std::set<std::uint64_t> ids;
    for (const auto& c : rig.list<events::LastingContact>()) {
      ids.insert(c.id);
      EXPECT_NE(c.state, events::ContactState::kEnd) << rate;
      if (c.time_s < 0.4) continue;
      EXPECT_NEAR(norm(c.slip_m_s), c.body == 0 ? 0.0 : 0.8, 1e-3) << rate;
      EXPECT_NEAR(c.sweep_m_s, c.body == 0 ? 0.5 : 0.0, 0.03) << rate;
      EXPECT_NEAR(c.other_sweep_m_s, c.body == 0 ? 0.5 : 0.8, 0.03) << rate;
    }
    EXPECT_EQ(ids.size(), 5U) << rate;
    EXPECT_TRUE(rig.faults.empty());
  }
}

TEST(Touches, OscillatingSlipIsSilent) {
  const bank::Bank box = make_box({0.1, 0.08, 0.04});
  const double weight = box.rigid.mass_kg * kGravity;
  for (const double rate : {60.0, 240.0, 1000.0})
    for (const auto& [steady, jitter, wanted] : {std::array{0.0, 0.01, 0.0}, {0.02, 0.0, 0.02}, {5e-4, 0.0, 0.0}, {0.02, 0.002, 0.02}}) {
      Rig rig;
      rig.add(box, "box", {0, 0, 0.02});
      rig.start();
      double slip = 0.0, sweep = 0.0;
      int records = 0;
      for (int n = 0; n < 0.5 * rate; ++n) {
        rig.poses[0].velocity_m_s[0] = steady + (n % 2 == 0 ? jitter : -jitter);
        rig.step(1.0 / rate, on_four_corners(0, {}, {0.05, 0.04, 0.02}, weight / rate));
      }
      for (const auto& c : rig.list<events::LastingContact>()) {
        if (c.time_s < 0.3) continue;
        slip += norm(c.slip_m_s);
        sweep += c.other_sweep_m_s;
        ++records;
      }
      EXPECT_NEAR(slip / records, wanted, 5e-4) << rate << " Hz, " << steady << " and " << jitter << " m/s";
      EXPECT_NEAR(sweep / records, wanted, 1e-3) << rate << " Hz, " << steady << " and " << jitter << " m/s";
    }
}

TEST(Touches, ManyPointsAreLimited) {
  const bank::Bank box = make_box({0.1, 0.08, 0.04});
  Rig rig;
  rig.add(box, "box", {0, 0, 0.02});
  rig.start();
  std::vector<TouchPoint> points;
  const double impulse = box.rigid.mass_kg * kGravity / 240.0 / 5000.0;
  for (int n = 0; n < 5000; ++n)
    points.push_back(on_ground(0, {-0.05 + 0.1 * (n % 100) / 100.0, -0.04 + 0.08 * (n / 100) / 50.0, 0.0}, impulse));
  for (int n = 0; n < 5; ++n) rig.step(1.0 / 240.0, points);
  EXPECT_EQ(rig.touches.get_counters().points, 5 * 4096);
  EXPECT_EQ(rig.touches.get_counters().dropped_points, 5 * 904);
  EXPECT_FALSE(rig.has_hits());
}

TEST(Touches, BadInputChangesNothing) {
  const bank::Bank box = make_box({0.1, 0.08, 0.04});
  Rig rig;
  rig.add(box, "box", {0, 0, 0.02});
  rig.start();
  rig.events.clear();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const TouchesPose good = rig.poses[0];
  const auto refuse = [&](auto&& change) {
    std::vector<TouchesPose> poses{good};
    change(poses[0]);
    EXPECT_THROW(rig.touches.step(0.01, poses, {}), InputError);
  };
  for (int k = 0; k < 3; ++k) {
    refuse([&](TouchesPose& p) { p.position_m[k] = nan; });
    refuse([&](TouchesPose& p) { p.velocity_m_s[k] = nan; });
    refuse([&](TouchesPose& p) { p.spin_rad_s[k] = nan; });
  }
  for (int k = 0; k < 4; ++k) refuse([&](TouchesPose& p) { p.rotation[k] = nan; });
  refuse([&](TouchesPose& p) { p.rotation = {2, 0, 0, 0}; });
  EXPECT_THROW(rig.touches.step(0.0, rig.poses, {}), InputError) << "time does not advance";
  EXPECT_THROW(rig.touches.step(nan, rig.poses, {}), InputError);
  EXPECT_THROW(rig.touches.step(0.01, {}, {}), InputError) << "poses are missing";
  EXPECT_THROW(rig.touches.add({.bank = &box, .inertia_kg_m2 = {1, 0, 0, 0, -1, 0, 0, 0, -1}}), InputError) << "two moments below 0";
  EXPECT_TRUE(rig.events.empty());
  EXPECT_EQ(rig.touches.get_counters().steps, 0);
  std::vector<TouchPoint> bad(9, on_ground(0, {}, 1e-3));
  bad[0].point_m[1] = nan;
  bad[1].normal[2] = nan;
  bad[2].normal = {0, 0, 2};
  bad[3].gap_m = nan;
  bad[4].impulse_n_s = std::numeric_limits<double>::infinity();
  bad[5].friction_n_s[0] = std::numeric_limits<double>::infinity();
  bad[6].a = 1;
  bad[7].b = 0;
  bad[8].b = -2;
  rig.step(0.01, bad);
  EXPECT_EQ(rig.touches.get_counters().bad_points, 9);
  EXPECT_EQ(rig.touches.get_counters().points, 0);
}

TEST(Touches, BodiesComeAndGo) {
  const bank::Bank box = make_box({0.1, 0.08, 0.04});
  const double dt = 1.0 / 240.0, weight = box.rigid.mass_kg * kGravity;
  Rig rig;
  rig.add(box, "a", {0, 0, 0.02});
  rig.start();
  const int second = rig.add(box, "b", {1, 0, 0.02}, {0, 0, -1});
  const auto step = [&] {
    auto points = on_four_corners(0, {}, {0.05, 0.04, 0.02}, weight * dt);
    for (const TouchPoint& p : on_four_corners(second, {1, 0, 0}, {0.05, 0.04, 0.02}, weight * dt)) points.push_back(p);
    rig.step(dt, points);
  };
  for (int n = 0; n < 20; ++n) {
    step();
    rig.poses[second].velocity_m_s = {};
  }
  EXPECT_FALSE(rig.has_hits()) << "a new body rests where it was put";
  rig.touches.remove(second);
  step();
  EXPECT_EQ(rig.touches.get_counters().bad_points, 4) << "points of a removed body";
  EXPECT_THROW(rig.touches.remove(second), InputError);
  EXPECT_EQ(rig.add(box, "c", {1, 0, 0.02}), second) << "its place is free";
  int open = 0;
  for (const auto& c : rig.list<events::LastingContact>())
    open += c.state == events::ContactState::kBegin ? 1 : c.state == events::ContactState::kEnd ? -1 : 0;
  EXPECT_EQ(open, 4) << "of the first body";
  EXPECT_TRUE(rig.faults.empty());
}

TEST(Touches, EventsWaitForRoom) {
  const bank::Bank ball = make_ball(kRadius);
  int room = 0;
  std::vector<events::Event> taken;
  Touches touches({}, [&](const events::Event& event) {
    if (room == 0) return false;
    --room;
    taken.push_back(event);
    return true;
  });
  const int body = touches.add({.body = 7, .bank = &ball});
  ASSERT_EQ(body, 0);
  std::vector<TouchesPose> poses(1);
  touches.start(0.0, poses);
  EXPECT_FALSE(touches.step(0.01, poses, {}));
  const std::int64_t waiting = touches.get_counters().waiting;
  EXPECT_GT(waiting, 0);
  for (int n = 1; n <= 1000; ++n) EXPECT_FALSE(touches.step(0.01 + 1e-7 * n, poses, {}));
  EXPECT_EQ(touches.get_counters().waiting, waiting) << "the last mark replaces those before it";
  EXPECT_EQ(touches.get_mark_s(), 0.0) << "what waits has not been passed on";
  room = 1000;
  EXPECT_TRUE(touches.step(0.02, poses, {}));
  EXPECT_EQ(touches.get_counters().waiting, 0);
  EXPECT_EQ(touches.get_mark_s(), 0.02);
  ASSERT_FALSE(taken.empty());
  EXPECT_EQ(std::get<events::BodyMotion>(taken.front()).body, 7) << "the first one";
}

}  // namespace
}  // namespace carillon::drive::tests
