// Lasting contacts: force against the weight, speeds against closed forms of sliding and rolling, no chatter.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <set>
#include <string>
#include <utility>

#include "tests/unit/runtime/physics/checks.hpp"
#include "tests/unit/runtime/physics/solids.hpp"

namespace carillon::physics::tests {
namespace {

using events::ContactState;
using events::LastingContact;

constexpr double kGravity = 9.81;

WorldSpec make_world(const bank::Bank& bank, Vec3 position, double friction) {
  WorldSpec w;
  w.ground = GroundSpec{};
  w.ground->friction = friction;
  BodySpec b;
  b.name = "body";
  b.bank = &bank;
  b.initial.position_m = position;
  b.friction = friction;
  w.bodies = {b};
  return w;
}

struct Outcome {
  std::vector<LastingContact> contacts;
  std::vector<Impulse> impulses;
  std::vector<events::BodyMotion> motions;
};

Outcome run(const WorldSpec& spec, double end_s) {
  World world(spec, {.end_s = end_s});
  Outcome outcome;
  world.advance(end_s, std::numeric_limits<double>::infinity(), [&](const events::Event& e) {
    EXPECT_EQ(events::find_fault(e), nullptr) << events::find_fault(e);
    if (const auto* c = std::get_if<LastingContact>(&e)) outcome.contacts.push_back(*c);
    if (const auto* p = std::get_if<Impulse>(&e)) outcome.impulses.push_back(*p);
    if (const auto* m = std::get_if<events::BodyMotion>(&e)) outcome.motions.push_back(*m);
  });
  return outcome;
}

/// Mean over the records in a span of time.
template <class Get>
double calc_mean(const Outcome& run, double from_s, double to_s, Get get) {
  double sum = 0.0;
  int count = 0;
  for (const LastingContact& c : run.contacts) {
    if (c.time_s < from_s || c.time_s > to_s) continue;
    sum += get(c);
    ++count;
  }
  EXPECT_GT(count, 0);
  return sum / std::max(count, 1);
}

TEST(LastingContacts, WeightOfBoxAtRest) {
  const bank::Bank box = make_box({0.06, 0.05, 0.04});
  const Outcome r = run(make_world(box, {0, 0, 0.05}, 0.5), 4.0);
  for (const Impulse& p : r.impulses) EXPECT_LT(p.time_s, 0.6) << "it lies by then";
  std::map<std::uint64_t, LastingContact> held;
  for (const LastingContact& c : r.contacts) {
    if (c.state == ContactState::kEnd) {
      held.erase(c.id);
    } else {
      EXPECT_EQ(held.count(c.id) == 0, c.state == ContactState::kBegin);
      if (c.state == ContactState::kBegin) {
        EXPECT_EQ(c.force_n, 0.0) << "the impact was heard already";
      }
      held[c.id] = c;
    }
  }
  EXPECT_EQ(held.size(), 4U) << "a corner each";
  double force = 0.0;
  for (const auto& [id, c] : held) {
    force += c.force_n;
    EXPECT_LT(norm(c.slip_m_s), 1e-4);
    EXPECT_LT(c.sweep_m_s, 1e-4);
    EXPECT_NEAR(c.normal[2], 1.0, 1e-3);
  }
  EXPECT_NEAR(force, box.rigid.mass_kg * kGravity, 1e-3 * box.rigid.mass_kg * kGravity);
}

TEST(LastingContacts, NoEffectWhenDisabled) {
  const bank::Bank box = make_box({0.06, 0.05, 0.04});
  const WorldSpec spec = make_world(box, {0.0, 0.0, 0.05}, 0.5);
  std::vector<events::Event> with, without;
  for (const bool has : {true, false}) {
    World world(spec, {.end_s = 0.5, .lasting_contacts = has});
    world.advance(0.5, std::numeric_limits<double>::infinity(), [&](const events::Event& e) {
      EXPECT_TRUE(has || !std::holds_alternative<LastingContact>(e));
      if (!std::holds_alternative<LastingContact>(e)) (has ? with : without).push_back(e);
    });
  }
  ASSERT_EQ(with.size(), without.size());
  for (std::size_t i = 0; i < with.size(); ++i) {
    ASSERT_EQ(with[i].index(), without[i].index());
    ASSERT_EQ(events::get_time_s(with[i]), events::get_time_s(without[i]));
    if (const auto* impulse = std::get_if<Impulse>(&with[i])) {
      ASSERT_EQ(impulse->impulse_n_s, std::get<Impulse>(without[i]).impulse_n_s);
    }
  }
}

TEST(LastingContacts, SweepOfSlidingBox) {
  // v = v0 - mu g t; it starts on the floor.
  const bank::Bank box = make_box({0.1, 0.1, 0.02});
  const double mu = 0.1, v0 = 1.0;
  WorldSpec w = make_world(box, {0, 0, 0.01}, mu);
  w.bodies[0].velocity_m_s = {v0, 0, 0};
  const Outcome r = run(w, 0.6);
  EXPECT_TRUE(r.impulses.empty());
  int seen = 0;
  for (const LastingContact& c : r.contacts) {
    if (c.time_s < 0.2 || c.time_s > 0.5) continue;
    const double v = v0 - mu * kGravity * c.time_s;
    EXPECT_NEAR(norm(c.slip_m_s), v, 0.01 * v0);
    EXPECT_NEAR(c.other_sweep_m_s, v, 0.02 * v0);
    EXPECT_LT(c.sweep_m_s, 1e-3 * v0) << "the corner that carries stays the same corner";
    ++seen;
  }
  EXPECT_GT(seen, 400);
  const double force = 4 * calc_mean(r, 0.2, 0.5, [](const LastingContact& c) { return c.force_n; });
  EXPECT_NEAR(force, box.rigid.mass_kg * kGravity, 0.02 * box.rigid.mass_kg * kGravity);
}

TEST(LastingContacts, NoSlipOfBoxHeldOnSlope) {
  // Ten degrees, friction 0.5: it slides from 0.3 m/s to rest, by mu g cos - g sin, and stays.
  const bank::Bank box = make_box({0.1, 0.1, 0.02});
  const double slope = 10.0 * 3.14159265358979 / 180.0;
  WorldSpec w = make_world(box, {0, 0, 0.01}, 0.5);
  w.gravity_m_s2 = {kGravity * std::sin(slope), 0.0, -kGravity * std::cos(slope)};
  w.bodies[0].velocity_m_s = {0.3, 0, 0};
  const Outcome r = run(w, 0.5);
  const double stops = 0.3 / (kGravity * (0.5 * std::cos(slope) - std::sin(slope)));
  int moving = 0, resting = 0;
  for (const LastingContact& c : r.contacts) {
    if (c.time_s > 0.05 && c.time_s < stops - 0.02) {
      EXPECT_NEAR(norm(c.slip_m_s), 0.3 * (1.0 - c.time_s / stops), 0.02);
      ++moving;
    } else if (c.time_s > stops + 0.01) {
      EXPECT_EQ(norm(c.slip_m_s), 0.0) << c.time_s;
      EXPECT_LT(c.sweep_m_s, 2e-4);
      EXPECT_LT(c.other_sweep_m_s, 2e-4);
      ++resting;
    }
  }
  EXPECT_GT(moving, 50);
  EXPECT_GT(resting, 4);
}

TEST(LastingContacts, SweepOfRollingBall) {
  const double radius = 0.03, v = 0.4;
  const bank::Bank ball = make_ball(radius, 5);
  WorldSpec w = make_world(ball, {0, 0, radius}, 0.5);
  w.bodies[0].velocity_m_s = {v, 0, 0};
  w.bodies[0].angular_velocity_rad_s = {0, v / radius, 0};
  const Outcome r = run(w, 0.5);
  int late = 0;
  for (const Impulse& p : r.impulses) late += p.time_s > 0.1 ? 1 : 0;
  EXPECT_EQ(late, 0) << "its facets are no strikes";
  // Rolling resistance and facets slow it down: the sweep is compared with its speed at that time.
  double now = 0.0;
  int count = 0;
  for (const events::BodyMotion& m : r.motions) {
    if (m.time_s < 0.1 || m.time_s > 0.4) continue;
    now += m.velocity_m_s[0];
    ++count;
  }
  now /= count;
  EXPECT_GT(now, 0.95 * v);
  EXPECT_LT(now, v) << "nothing drives it";
  EXPECT_NEAR(calc_mean(r, 0.1, 0.4, [](const LastingContact& c) { return c.sweep_m_s; }), now, 0.15 * now);
  EXPECT_NEAR(calc_mean(r, 0.1, 0.4, [](const LastingContact& c) { return c.other_sweep_m_s; }), now, 0.15 * now);
  EXPECT_LT(calc_mean(r, 0.1, 0.4, [](const LastingContact& c) { return norm(c.slip_m_s); }), 0.1 * now);
  EXPECT_NEAR(calc_mean(r, 0.1, 0.4, [](const LastingContact& c) { return c.spin_rad_s; }), now / radius, 0.1 * now / radius);
}

/// The records before the first hit on bodies at rest must not show its effect.
void expect_nothing_before_hit(const WorldSpec& spec, double end_s) {
  const Outcome r = run(spec, end_s);
  const double rested = 0.3;
  const auto hit = std::find_if(r.impulses.begin(), r.impulses.end(), [&](const Impulse& p) { return p.time_s > rested; });
  ASSERT_NE(hit, r.impulses.end());
  const double struck = hit->time_s - 1e-4;  // hits so near in time are one
  std::map<std::pair<std::uint64_t, std::int32_t>, LastingContact> held;
  int seen = 0;
  for (const LastingContact& c : r.contacts) {
    const auto key = std::pair(c.id, c.body);
    const auto before = held.find(key);
    if (before != held.end()) {
      EXPECT_GE(c.time_s, before->second.time_s);
      if (before->second.time_s < struck && c.time_s > struck) {
        EXPECT_GT(before->second.time_s, struck - 2.1e-3) << "a window";
        EXPECT_EQ(norm(before->second.slip_m_s), 0.0);
        EXPECT_EQ(before->second.sweep_m_s, 0.0);
        ++seen;
      }
    }
    if (c.state == ContactState::kEnd)
      held.erase(key);
    else
      held[key] = c;
  }
  EXPECT_GT(seen, 0);
}

TEST(LastingContacts, NoChangeBeforeHitAfterRest) {
  const bank::Bank box = make_box({0.06, 0.05, 0.04}), ball = make_ball(0.03, 3);
  WorldSpec stack = make_world(box, {0, 0, 0.02}, 0.4);
  for (int i = 1; i < 8; ++i) {
    BodySpec b = stack.bodies[0];
    b.name = "box " + std::to_string(i);
    b.initial.position_m[2] += 0.04 * i;
    stack.bodies.push_back(b);
  }
  BodySpec thrown = stack.bodies[0];
  thrown.name = "ball";
  thrown.bank = &ball;
  thrown.initial.position_m = {-0.8, 0.003, 0.3};
  thrown.velocity_m_s = {1.5, 0, 2.4};
  stack.bodies.push_back(thrown);
  expect_nothing_before_hit(stack, 0.7);

  WorldSpec block = make_world(box, {0, 0, 0.02}, 0.4);
  for (const double side : {-1.0, 1.0}) {
    thrown.name = side < 0.0 ? "left" : "right";
    thrown.initial.position_m = {0.75 * side, 0.002 * side, 0.1};
    thrown.velocity_m_s = {-1.5 * side, 0, 2.15 + 0.02 * side};
    block.bodies.push_back(thrown);
  }
  expect_nothing_before_hit(block, 0.7);
}

TEST(LastingContacts, PairedRecordsWithOneId) {
  const bank::Bank box = make_box({0.06, 0.05, 0.04}), shelf = make_box({0.3, 0.3, 0.02});
  WorldSpec w = make_world(box, {0, 0, 0.03}, 0.5);
  w.ground.reset();
  BodySpec under = w.bodies[0];
  under.name = "shelf";
  under.bank = &shelf;
  under.fixed = true;
  under.initial.position_m = {0, 0, 0};
  w.bodies.push_back(under);
  const Outcome r = run(w, 0.3);
  ASSERT_GT(r.contacts.size(), 8U);
  std::map<std::pair<std::uint64_t, double>, std::vector<LastingContact>> pairs;
  for (const LastingContact& c : r.contacts) pairs[{c.id, c.time_s}].push_back(c);
  for (const auto& [key, both] : pairs) {
    ASSERT_EQ(both.size(), 2U);
    EXPECT_EQ(both[0].body, both[1].other);
    EXPECT_EQ(both[0].force_n, both[1].force_n);
    EXPECT_EQ(both[0].sweep_m_s, both[1].other_sweep_m_s);
    // Both frames lie along the world's here.
    EXPECT_LT(norm(both[0].normal + both[1].normal), 1e-3);
  }
}

TEST(LastingContacts, IdsByPairAndTouch) {
  const bank::Bank box = make_box({0.1, 0.08, 0.04});
  WorldSpec alone = make_world(box, {0, 0, 0.0205}, 0.4);
  alone.bodies[0].velocity_m_s = {0.5, 0, 0};
  WorldSpec crowded = alone;
  BodySpec far = alone.bodies[0];
  far.name = "far";
  far.initial.position_m = {0.0, 3.0, 0.0215};
  far.velocity_m_s = {-0.2, 0.3, 0.0};
  crowded.bodies.insert(crowded.bodies.begin(), far);
  const auto list = [](const Outcome& outcome, int body) {
    std::vector<LastingContact> own;
    for (LastingContact c : outcome.contacts) {
      if (c.body == body) own.push_back(c);
    }
    return own;
  };
  const std::vector<LastingContact> x = list(run(alone, 0.4), 0), y = list(run(crowded, 0.4), 1);
  ASSERT_GT(x.size(), 50u);
  ASSERT_EQ(x.size(), y.size());
  std::set<std::uint64_t> ids;
  for (std::size_t i = 0; i < x.size(); ++i) {
    ASSERT_EQ(x[i].id, y[i].id);
    ASSERT_EQ(x[i].time_s, y[i].time_s);
    ASSERT_EQ(x[i].force_n, y[i].force_n);
    ids.insert(x[i].id);
  }
  for (const LastingContact& c : list(run(crowded, 0.4), 0)) EXPECT_EQ(ids.count(c.id), 0u) << "another pair";
}

}  // namespace
}  // namespace carillon::physics::tests
