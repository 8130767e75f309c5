// Bodies without contact move independently; results do not depend on the slices, bit for bit.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "runtime/base/error.hpp"
#include "tests/unit/runtime/physics/checks.hpp"
#include "tests/unit/runtime/physics/solids.hpp"

namespace carillon::physics::tests {
namespace {

constexpr double kForever = std::numeric_limits<double>::infinity();

BodySpec make_body(const std::string& name, const bank::Bank& bank, Vec3 position) {
  BodySpec b;
  b.name = name;
  b.bank = &bank;
  b.initial.position_m = position;
  return b;
}

/// Boxes over the ground, a metre apart, each at another height and slightly turned.
WorldSpec make_rain(const bank::Bank& box, int count) {
  WorldSpec w;
  w.ground = GroundSpec{};
  for (int i = 0; i < count; ++i) {
    BodySpec b = make_body("box " + std::to_string(i), box, {1.0 * (i % 5), 1.0 * (i / 5), 0.2 + 0.01 * i});
    b.initial.rotation = {std::cos(0.1 + 0.05 * i), std::sin(0.1 + 0.05 * i), 0.0, 0.0};
    w.bodies.push_back(b);
  }
  return w;
}

/// Two balls that meet in flight far from everything, one more that falls alone, a shelf.
WorldSpec make_meeting(const bank::Bank& ball, const bank::Bank& shelf) {
  WorldSpec w;
  w.bodies = {make_body("left", ball, {-0.3, 0, 1}), make_body("alone", ball, {0, 2, 1}), make_body("right", ball, {0.3, 0.004, 1.003}),
              make_body("shelf", shelf, {0, 0, 0})};
  w.bodies[0].velocity_m_s = {4, 0, 0};
  w.bodies[2].velocity_m_s = {-3, 0, 0};
  w.bodies[3].fixed = true;
  return w;
}

std::vector<events::Event> run(const WorldSpec& spec, double end_s, bool islands, double slice_s, double cpu_s = kForever) {
  World world(spec, {.end_s = end_s, .islands = islands});
  std::vector<events::Event> events;
  double asked = 0.0;
  for (double reached = 0.0; reached < end_s - 1e-6;) {
    asked = std::min(end_s, std::max(asked, reached) + slice_s);
    reached = world.advance(asked, cpu_s, [&](const events::Event& e) { events.push_back(e); });
  }
  return events;
}

std::vector<Impulse> find_impulses(const std::vector<events::Event>& events, std::int32_t body) {
  std::vector<Impulse> found;
  for (const events::Event& e : events) {
    if (const auto* impulse = std::get_if<Impulse>(&e); impulse != nullptr && impulse->body == body) found.push_back(*impulse);
  }
  return found;
}

void expect_same_bits(const std::vector<events::Event>& a, const std::vector<events::Event>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_EQ(a[i].index(), b[i].index()) << i;
    ASSERT_EQ(events::get_time_s(a[i]), events::get_time_s(b[i])) << i;
    if (const auto* p = std::get_if<Impulse>(&a[i])) {
      const auto& q = std::get<Impulse>(b[i]);
      ASSERT_TRUE(p->body == q.body && p->triangle == q.triangle && p->impulse_n_s == q.impulse_n_s && p->barycentric == q.barycentric &&
                  p->duration_s == q.duration_s)
          << i << " at " << p->time_s << " of " << p->body << " and " << q.body << ": " << p->impulse_n_s[2] << " " << q.impulse_n_s[2];
    } else if (const auto* m = std::get_if<events::BodyMotion>(&a[i])) {
      const auto& n = std::get<events::BodyMotion>(b[i]);
      ASSERT_TRUE(m->body == n.body && m->position_m == n.position_m && m->velocity_m_s == n.velocity_m_s && m->rotation == n.rotation);
    }
  }
}

TEST(Islands, FirstImpactsOfOneSystem) {
  // Every box lands on an edge: up to its second impact nothing is chaotic.
  const bank::Bank box = make_box({0.06, 0.05, 0.04});
  const WorldSpec spec = make_rain(box, 6);
  const auto apart = run(spec, 0.5, true, 0.5), together = run(spec, 0.5, false, 0.5);
  for (int body = 0; body < 6; ++body) {
    const auto a = find_impulses(apart, body), b = find_impulses(together, body);
    ASSERT_GE(a.size(), 2U);
    ASSERT_GE(b.size(), 2U);
    for (int hit = 0; hit < 2; ++hit) {
      EXPECT_NEAR(a[hit].time_s, b[hit].time_s, 1e-6) << body;
      EXPECT_LT(norm(point_on_body(box, a[hit]) - point_on_body(box, b[hit])), 1e-6) << body;
      EXPECT_LT(norm(a[hit].impulse_n_s - b[hit].impulse_n_s), 1e-4 * norm(b[hit].impulse_n_s)) << body;
    }
  }
}

TEST(Islands, BitwiseIndependence) {
  // A ball that rolls takes shorter steps than boxes do, and a ball that is fast still shorter ones.
  const bank::Bank box = make_box({0.06, 0.05, 0.04}), ball = make_ball(0.03, 3), shot = make_ball(0.004, 3);
  WorldSpec boxes = make_rain(box, 4);
  for (int i = 0; i < 3; ++i) boxes.bodies.push_back(make_body("stack " + std::to_string(i), box, {0.02 * i, -2.0, 0.021 + 0.045 * i}));
  // Boxes that sleep when a ball comes to them, each in another small step of its window.
  for (int i = 0; i < 4; ++i) {
    boxes.bodies.push_back(make_body("asleep " + std::to_string(i), box, {1.0 * i, -4.0, 0.02}));
    boxes.bodies.push_back(make_body("falls " + std::to_string(i), ball, {i + 0.01, -4.0, 0.5 + 0.0007 * i}));
  }
  const auto count = static_cast<int>(boxes.bodies.size());
  WorldSpec more = boxes;
  more.bodies.push_back(make_body("rolls", ball, {0, 5, 0.03}));
  more.bodies.back().velocity_m_s = {1.0, 0, 0};
  more.bodies.back().angular_velocity_rad_s = {0, 1.0 / 0.03, 0};
  more.bodies.push_back(make_body("fast", shot, {0, 8, 0.0041}));
  more.bodies.back().velocity_m_s = {60.0, 0, 0};
  const auto alone = run(boxes, 1.0, true, 1.0);
  auto among = run(more, 1.0, true, 1.0);
  const auto is_other = [&](const events::Event& e) {
    if (const auto* m = std::get_if<events::BodyMotion>(&e)) return m->body >= count;
    if (const auto* p = std::get_if<Impulse>(&e)) return p->body >= count;
    if (const auto* c = std::get_if<events::LastingContact>(&e)) return c->body >= count;
    return false;
  };
  EXPECT_TRUE(std::any_of(among.begin(), among.end(), is_other));
  std::erase_if(among, is_other);
  expect_same_bits(among, alone);
}

TEST(Islands, JoiningAndSeparation) {
  const bank::Bank ball = make_ball(0.03, 3), shelf = make_box({1.5, 0.5, 0.02});
  const WorldSpec spec = make_meeting(ball, shelf);
  World world(spec, {.end_s = 0.6});
  std::vector<events::Event> events;
  std::int64_t fewest = 99, max = 0;
  for (int k = 1; k <= 300; ++k) {
    world.advance(0.002 * k, kForever, [&](const events::Event& e) { events.push_back(e); });
    fewest = std::min(fewest, world.get_statistics().islands);
    max = std::max(max, world.get_statistics().islands);
  }
  EXPECT_EQ(fewest, 2);
  EXPECT_EQ(max, 3);
  const auto together = run(spec, 0.6, false, 0.6);
  for (const int body : {0, 2}) {
    const auto a = find_impulses(events, body), b = find_impulses(together, body);
    ASSERT_FALSE(a.empty());
    EXPECT_EQ(a[0].other, body == 0 ? 2 : 0);
    // They close at 7 m/s over 0.54 m, seen from either.
    EXPECT_NEAR(a[0].time_s - 0.5 * a[0].duration_s, 0.54 / 7.0, 3e-4);
    EXPECT_NEAR(a[0].time_s, b[0].time_s, 1e-6);
    EXPECT_LT(norm(a[0].impulse_n_s - b[0].impulse_n_s), 1e-4 * norm(b[0].impulse_n_s));
  }
  EXPECT_TRUE(find_impulses(events, 1).empty());
}

TEST(Islands, RepeatedWindowAfterUnplannedMeeting) {
  // A heavy fast ball hits a light one that stands; the light one leaves at nearly twice the speed and meets a third within the same 2 ms.
  const bank::Bank heavy = make_ball(0.2, 3), light = make_ball(0.005, 3);
  WorldSpec w;
  w.gravity_m_s2 = {0, 0, 0};
  w.bodies = {make_body("heavy", heavy, {-0.2061, 0, 0}), make_body("light", light, {0, 0, 0}), make_body("third", light, {0.0261, 0, 0})};
  for (BodySpec& b : w.bodies) b.restitution = 1.0;
  w.bodies[0].velocity_m_s = {10, 0, 0};
  const auto apart = run(w, 0.01, true, 0.01);
  const auto on_third = find_impulses(apart, 2);
  ASSERT_FALSE(on_third.empty()) << "the light ball went through the third";
  // 1.1 mm at 10 m/s, then 16.1 mm at 20 m/s.
  EXPECT_NEAR(on_third[0].time_s - 0.5 * on_third[0].duration_s, 1.1e-3 / 10 + 16.1e-3 / 20, 2e-5);
}

TEST(Flight, PrecessionOfSymmetricTop) {
  // Euler's top: the axis goes round L at |L| / I_1 (Landau and Lifshitz, Mechanics, section 33).
  const bank::Bank box = make_box({0.04, 0.04, 0.1});
  WorldSpec w;
  w.bodies = {make_body("top", box, {0, 0, 0})};
  const Vec3 spin{3.0, -2.0, 40.0}, v{0.5, 0.25, 4.0};
  w.bodies[0].angular_velocity_rad_s = spin;
  w.bodies[0].velocity_m_s = v;
  const Simulation s = simulate(w, 0.7);
  const auto& inertia = box.rigid.inertia_kg_m2;
  const Vec3 momentum{inertia[0] * spin[0], inertia[4] * spin[1], inertia[8] * spin[2]};
  const double size = norm(momentum);
  const Vec3 n = (1.0 / size) * momentum;
  for (const Pose& pose : s.poses[0]) {
    const double half = 0.5 * size / inertia[0] * pose.time_s, t = pose.time_s;
    const Vec3 expected = rotate({std::cos(half), std::sin(half) * n[0], std::sin(half) * n[1], std::sin(half) * n[2]}, {0, 0, 1});
    ASSERT_LT(norm(rotate(pose.rotation, {0, 0, 1}) - expected), 1e-6) << t;
    ASSERT_LT(norm(pose.position_m - Vec3{v[0] * t, v[1] * t, v[2] * t - 0.5 * 9.81 * t * t}), 1e-9) << t;
  }
}

TEST(Sleepers, NoCostUntilHit) {
  const bank::Bank box = make_box({0.1, 0.1, 0.1}), ball = make_ball(0.03, 3);
  WorldSpec w;
  w.ground = GroundSpec{};
  w.bodies = {make_body("box", box, {0, 0, 0.05}), make_body("ball", ball, {0.02, 0, 5.0})};
  World world(w, {.end_s = 2.0});
  std::vector<events::Event> events;
  const auto keep = [&](const events::Event& e) { events.push_back(e); };
  world.advance(0.6, kForever, keep);
  const std::int64_t before = world.get_statistics().steps;
  world.advance(0.7, kForever, keep);
  EXPECT_LE(world.get_statistics().steps, before + 50) << "only the ball steps, every 2 ms";
  const double height = 5.0 - 0.1 - 0.03, touch = std::sqrt(2 * height / 9.81);
  world.advance(2.0, kForever, keep);
  const auto hits = find_impulses(events, 0);
  const auto is_hit = [&](const Impulse& p) { return p.other == 1 && std::abs(p.time_s - 0.5 * p.duration_s - touch) < 1e-3; };
  EXPECT_TRUE(std::any_of(hits.begin(), hits.end(), is_hit));
  const auto is_passed_on = [&](const Impulse& p) { return p.other == -1 && std::abs(p.time_s - touch) < 0.05; };
  EXPECT_TRUE(std::any_of(hits.begin(), hits.end(), is_passed_on)) << "the floor feels what the box feels";
}

TEST(Slices, SameBitsInTimeSlices) {
  const bank::Bank ball = make_ball(0.03, 3), shelf = make_box({1.5, 0.5, 0.02});
  const WorldSpec spec = make_meeting(ball, shelf);
  const auto whole = run(spec, 0.6, true, 0.6);
  expect_same_bits(run(spec, 0.6, true, 0.0007), whole);
  expect_same_bits(run(spec, 0.6, true, 0.05, 0.0), whole);  // one step a call
}

TEST(Slices, FinalMark) {
  const bank::Bank box = make_box({0.06, 0.05, 0.04});
  const auto events = run(make_rain(box, 3), 0.5, true, 0.01);
  double mark = 0.0;
  for (const events::Event& e : events) {
    ASSERT_EQ(events::find_fault(e), nullptr);
    ASSERT_GE(events::get_time_s(e), mark);
    if (std::holds_alternative<events::TimeWatermark>(e)) mark = events::get_time_s(e);
  }
  EXPECT_TRUE(std::holds_alternative<events::TimeWatermark>(events.back()));
  EXPECT_EQ(mark, 0.5);
}

TEST(Slices, FinalMarkOfCrowd) {
  // A pile, whose groups strike once a step: pulses still have their own instants.
  const bank::Bank box = make_box({0.06, 0.05, 0.04});
  WorldSpec w;
  w.ground = GroundSpec{};
  for (int i = 0; i < 20; ++i) {
    w.bodies.push_back(
        make_body("box " + std::to_string(i), box, {0.045 * (i % 2 ? 1 : -1), 0.045 * (i / 2 % 2 ? 1 : -1), 0.06 + 0.09 * (i / 4)}));
    const double half = 0.5 * (0.3 + 0.7 * i);
    w.bodies.back().initial.rotation = {std::cos(half), 0.6 * std::sin(half), 0.0, 0.8 * std::sin(half)};
  }
  for (const double step_s : {2.5e-4, 2e-3}) {
    World world(w, {.contact_step_s = step_s, .end_s = 0.6});
    double mark = -1.0;
    int impulses = 0;
    world.advance(0.6, kForever, [&](const events::Event& e) {
      EXPECT_GE(events::get_time_s(e), mark);
      if (std::holds_alternative<events::TimeWatermark>(e)) mark = events::get_time_s(e);
      if (std::holds_alternative<events::Impulse>(e)) ++impulses;
    });
    EXPECT_GT(impulses, 200);
  }
}

TEST(Slices, CpuLimitAfterOneStep) {
  const bank::Bank box = make_box({0.06, 0.05, 0.04});
  World world(make_rain(box, 20), {.end_s = 1.0});
  const auto ignore = [](const events::Event&) {};
  while (world.get_statistics().steps == 0) world.advance(1.0, 0.0, ignore);
  for (int call = 0; call < 50; ++call) {
    const std::int64_t before = world.get_statistics().steps;
    EXPECT_LT(world.advance(1.0, 0.0, ignore), 0.5);
    EXPECT_LE(world.get_statistics().steps, before + 1);  // in the air: no touch is searched for
  }
}

TEST(Worlds, RefusalOfInvalidEnd) {
  const bank::Bank ball = make_ball(0.03, 2);
  WorldSpec spec;
  spec.bodies = {make_body("ball", ball, {0, 0, 1})};
  EXPECT_THROW(World(spec, {.end_s = -1.0}), InputError);
  EXPECT_THROW(World(spec, {.end_s = std::numeric_limits<double>::quiet_NaN()}), InputError);
}

}  // namespace
}  // namespace carillon::physics::tests
