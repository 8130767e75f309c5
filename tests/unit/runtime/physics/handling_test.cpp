// Bodies pushed, held, added and removed while the world runs.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <random>
#include <string>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "runtime/base/error.hpp"
#include "tests/unit/runtime/physics/bodies.hpp"
#include "tests/unit/runtime/physics/plate_bank.hpp"

namespace carillon::physics::tests {
namespace {

constexpr double kGravity = 9.81, kForever = std::numeric_limits<double>::infinity();

/// A world, its last motions, and its open contacts.
class Watched {
 public:
  explicit Watched(const WorldSpec& spec) : world(spec, {.audits_energy = true}) {}

  double run(double until_s) {
    return world.advance(until_s, kForever, [&](const events::Event& event) {
      EXPECT_EQ(events::find_fault(event), nullptr);
      const double time_s = events::get_time_s(event);
      EXPECT_GE(time_s, mark_s_) << "after the mark";
      if (std::holds_alternative<events::TimeWatermark>(event)) mark_s_ = time_s;
      if (const auto* motion = std::get_if<events::BodyMotion>(&event)) last[motion->body] = *motion;
      if (const auto* contact = std::get_if<events::LastingContact>(&event)) {
        if (contact->state == events::ContactState::kEnd)
          open.erase({contact->body, contact->id});
        else
          open[{contact->body, contact->id}] = contact->other;
      }
      if (std::holds_alternative<events::Force>(event) || std::holds_alternative<Impulse>(event)) ++hits;
    });
  }
  EnergyAudit get_energy() const { return world.get_statistics().energy; }
  double get_deepest_m() const { return world.get_statistics().contacts.deepest.depth_m; }
  int count_contacts(int body) const {
    int count = 0;
    for (const auto& [key, other] : open)
      if (key.first == body || other == body) ++count;
    return count;
  }

  World world;
  std::map<int, events::BodyMotion> last;
  std::map<std::pair<int, std::uint64_t>, int> open;
  int hits = 0;

 private:
  double mark_s_ = -1.0;
};

WorldSpec make_floor(std::vector<BodySpec> bodies) {
  WorldSpec spec;
  spec.bodies = std::move(bodies);
  spec.ground.emplace();
  return spec;
}

TEST(Push, MomentumAndEnergyInClosedForm) {
  const bank::Bank box = make_box({0.06, 0.05, 0.04});
  WorldSpec spec;
  spec.gravity_m_s2 = {};
  spec.bodies = {make_body("box", box, {0, 0, 0})};
  Watched w(spec);
  w.run(0.01);
  const Vec3 impulse{0.02, -0.03, 0.05}, at{0.03, 0.01, -0.02};
  w.world.push(0, at, impulse);
  w.run(0.5);
  const double mass = box.rigid.mass_kg;
  const Vec3 couple = cross(at, impulse);
  double spinning_j = 0.0;
  for (int k = 0; k < 3; ++k) spinning_j += 0.5 * couple[k] * couple[k] / box.rigid.inertia_kg_m2[4 * k];
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(mass * w.last[0].velocity_m_s[k], impulse[k], 1e-15);
    EXPECT_NEAR(w.last[0].position_m[k], (w.last[0].time_s - 0.01) * impulse[k] / mass, 1e-12) << "from the time of the push on";
  }
  const EnergyAudit energy = w.get_energy();
  EXPECT_NEAR(energy.given_j, 0.5 * dot(impulse, impulse) / mass + spinning_j, 1e-14);
  EXPECT_LT(energy.error_j, 1e-8 * energy.given_j);
}

TEST(Push, WakesWhatSleeps) {
  const bank::Bank box = make_box({0.06, 0.05, 0.04});
  Watched w(make_floor({make_body("low", box, {0, 0, 0.02}), make_body("high", box, {0, 0, 0.06})}));
  w.run(1.0);
  EXPECT_EQ(w.last[0].velocity_m_s, Vec3{});
  w.world.push(1, {0.03, 0.0, 0.06}, {-0.5 * box.rigid.mass_kg, 0, 0});
  w.run(1.002);
  EXPECT_LT(w.last[1].velocity_m_s[0], -0.3);
  w.run(3.0);
  EXPECT_LT(w.last[1].position_m[0], -0.01);
  EXPECT_LT(w.get_deepest_m(), 1e-4);
  EXPECT_LT(w.get_energy().error_j, 1e-6 * w.get_energy().start_j);
}

TEST(Grab, SagAndFrequencyOfASpring) {
  const bank::Bank ball = make_ball(0.03, 3);
  WorldSpec spec;
  spec.bodies = {make_body("ball", ball, {0, 0, 1})};
  Watched w(spec);
  w.world.grab(0, {0, 0, 1}, {.frequency_hz = 2.0, .damping_ratio = 0.0, .max_force_n = 1e3});
  // Hangs at g / omega^2 below the target, and swings about that from the start.
  const double omega = 2.0 * M_PI * 2.0, sag = kGravity / (omega * omega);
  for (double time_s = 0.05; time_s < 2.0; time_s += 0.05) {
    w.run(time_s);
    EXPECT_NEAR(w.last[0].position_m[2], 1.0 - sag * (1.0 - std::cos(omega * w.last[0].time_s)), 0.02 * sag) << time_s;
  }
  EXPECT_LT(w.get_energy().error_j, 1e-9);
  w.world.grab(0, w.last[0].position_m);
  w.run(4.0);
  EXPECT_NEAR(norm(w.last[0].velocity_m_s), 0.0, 1e-3) << "critically damped";
}

TEST(Grab, BooksCloseWhenABodyIsMovedAndThrown) {
  const bank::Bank box = make_box({0.06, 0.05, 0.04});
  Watched w(make_floor({make_body("box", box, {0, 0, 0.02}), make_body("other", box, {0.5, 0, 0.02})}));
  w.run(0.5);
  w.world.grab(0, {0.03, 0.02, 0.04});
  w.world.drag(0, {0.0, 0.0, 0.4}, 0.4);
  w.run(1.0);
  const double lifted_j = w.get_energy().given_j;
  EXPECT_GT(lifted_j, 0.8 * box.rigid.mass_kg * kGravity * 0.36);
  EXPECT_LT(w.get_energy().error_j, 1e-3 * lifted_j);
  w.world.drag(0, {0.5, 0.0, 0.4}, 0.2);
  w.run(1.15);
  w.world.release(0);
  w.world.release(0);  // nothing happens
  const double thrown_j = w.get_energy().given_j;
  EXPECT_GT(w.last[0].velocity_m_s[0], 1.0);
  w.run(3.0);
  const EnergyAudit energy = w.get_energy();
  EXPECT_EQ(energy.given_j, thrown_j) << "a body that is let go gets nothing";
  EXPECT_GT(thrown_j, lifted_j + 0.5 * box.rigid.mass_kg);
  EXPECT_LT(energy.error_j, 1e-3 * thrown_j);
  EXPECT_GT(w.last[0].position_m[0], 0.2);
  EXPECT_LT(w.get_deepest_m(), 1e-4);
}

TEST(Grab, HoldsABodyOnAJoint) {
  const bank::Bank bar = make_box({0.3, 0.02, 0.01});
  WorldSpec spec;
  spec.bodies = {make_body("bar", bar, {0.15, 0, 0.5})};
  spec.joints = {{.kind = joints::Kind::kHinge, .body = 0, .to = -1, .at_m = {0, 0, 0.5}, .axis = {0, 1, 0}}};
  Watched w(spec);
  w.world.grab(0, {0.3, 0, 0.5}, {.frequency_hz = 8.0});
  w.run(1.0);
  EXPECT_NEAR(w.last[0].position_m[2], 0.5, 0.01) << "held level";
  w.world.drag(0, {0.0, 0, 0.8}, 0.5);
  w.run(2.0);
  EXPECT_NEAR(w.last[0].position_m[2], 0.65, 0.01) << "upright";
  EXPECT_LT(w.get_energy().error_j, 1e-3 * w.get_energy().given_j);
  EXPECT_THROW(w.world.remove(0), InputError);
}

TEST(Grab, PressedBodiesDoNotEnterEachOther) {
  const bank::Bank box = make_box({0.06, 0.05, 0.04}), slab = make_box({0.3, 0.3, 0.03}), ball = make_ball(0.03, 3);
  for (const bank::Bank* bank : {&box, &ball}) {
    BodySpec shelf = make_body("shelf", slab, {0, 0, 0.2});
    shelf.fixed = true;
    Watched w(make_floor(
        {make_body("held", *bank, {0, 0, 0.3}), shelf, make_body("loose", box, {0.08, 0, 0.235}), make_body("low", box, {0.5, 0, 0.02})}));
    w.run(0.6);
    w.world.grab(0, w.last[0].position_m);
    for (const Vec3& target : {Vec3{0, 0, 0.1}, Vec3{0.2, 0, 0.2}, Vec3{0.5, 0.1, 0.3}, Vec3{0.5, 0, -0.2}, Vec3{-0.3, 0, -0.5}}) {
      w.world.drag(0, target, 0.3);
      w.run(w.world.get_pose(0).time_s + 0.6);
      EXPECT_LT(w.get_deepest_m(), 1.5e-4) << target[0] << " " << target[2];
    }
    EXPECT_LT(w.get_energy().error_j, 2e-2 * w.get_energy().given_j);
  }
}

TEST(Remove, StackFallsWhenItsLowestIsRemoved) {
  const bank::Bank box = make_box({0.06, 0.05, 0.04});
  for (const bool is_asleep : {true, false}) {
    std::vector<BodySpec> bodies;
    for (int i = 0; i < 4; ++i) bodies.push_back(make_body("box " + std::to_string(i), box, {0, 0, 0.02 + 0.04 * i}));
    Watched w(make_floor(bodies));
    w.run(is_asleep ? 1.0 : 0.01);
    w.world.remove(0);
    w.world.remove(2);
    EXPECT_TRUE(w.world.is_absent(2));
    EXPECT_THROW(w.world.push(0, {}, {}), InputError);
    w.run(3.0);
    EXPECT_NEAR(w.last[1].position_m[2], 0.02, 1e-4);
    EXPECT_NEAR(w.last[3].position_m[2], 0.06, 1e-4);
    EXPECT_EQ(w.count_contacts(0), 0) << "all have ended";
    EXPECT_EQ(w.count_contacts(2), 0);
    EXPECT_LT(w.get_energy().error_j, 1e-6 * w.get_energy().start_j);
    EXPECT_NEAR(w.get_energy().given_j, -box.rigid.mass_kg * kGravity * (0.02 + 0.1), 1e-6);
    w.world.add(0, {.pose = {.position_m = {0, 0, 0.3}}});
    w.run(4.0);
    EXPECT_NEAR(w.last[0].position_m[2], 0.10, 1e-4) << "on top of the others";
    EXPECT_LT(w.get_energy().error_j, 1e-6 * w.get_energy().start_j);
    EXPECT_LT(w.get_deepest_m(), 1e-4);
  }
}

TEST(Remove, LastContactEndsWhereAllSleep) {
  const bank::Bank box = make_box({0.06, 0.05, 0.04});
  Watched w(make_floor({make_body("near", box, {0, 0, 0.025}), make_body("far", box, {1, 0, 0.025})}));
  w.run(1.0);
  ASSERT_GT(w.count_contacts(0), 0);
  w.world.remove(0);
  w.run(1.1);
  EXPECT_EQ(w.count_contacts(0), 0);
  EXPECT_GT(w.count_contacts(1), 0);
}

TEST(Remove, FixedShelf) {
  const bank::Bank box = make_box({0.06, 0.05, 0.04}), slab = make_box({0.3, 0.3, 0.03});
  BodySpec shelf = make_body("shelf", slab, {0, 0, 0.2});
  shelf.fixed = true;
  Watched w(make_floor({make_body("box", box, {0, 0, 0.235}), shelf}));
  w.run(1.0);
  w.world.remove(1);
  w.run(2.0);
  EXPECT_NEAR(w.last[0].position_m[2], 0.02, 1e-4);
  w.world.add(1, {.pose = {.position_m = {0, 0, 0.0551}}});
  w.world.push(0, {0, 0, 0.02}, {0, 0, 0.2 * box.rigid.mass_kg});
  const int hits = w.hits;
  w.run(3.0);
  EXPECT_GT(w.hits, hits) << "against the shelf above it";
  EXPECT_LT(w.get_deepest_m(), 1e-4);
}

TEST(Add, NewBodyIsAsOneThatWasAbsent) {
  const bank::Bank box = make_box({0.06, 0.05, 0.04});
  BodySpec later = make_body("later", box, {0.01, 0, 0.1});
  later.velocity_m_s = {0.1, 0, -1};
  const auto run = [&](bool is_absent) {
    WorldSpec spec = make_floor({make_body("box", box, {0, 0, 0.02})});
    if (is_absent) spec.bodies.push_back(later), spec.bodies.back().absent = true;
    Watched w(spec);
    w.run(0.3);
    if (is_absent)
      w.world.add(1, {.pose = later.initial, .velocity_m_s = later.velocity_m_s});
    else
      EXPECT_EQ(w.world.add(later), 1);
    w.run(1.5);
    EXPECT_GT(w.hits, 0);
    EXPECT_LT(w.get_energy().error_j, 1e-6);
    return std::tuple(w.hits, w.last[0].position_m, w.last[1].position_m, w.last[1].rotation, w.open);
  };
  EXPECT_EQ(run(true), run(false));
}

TEST(Add, NewBodiesMakeAPile) {
  const bank::Bank box = make_box({0.06, 0.05, 0.04}), slab = make_box({0.3, 0.3, 0.03});
  Watched w(make_floor({make_body("box", box, {0, 0, 0.02})}));
  w.world.grab(0, {0, 0, 0.02});  // before the start, and while others are added
  double placed_j = 0.0;
  for (int i = 1; i <= 12; ++i) {
    w.run(0.15 * i);
    BodySpec spec = make_body("box " + std::to_string(i), box, {0.004 * (i % 3), 0.003 * (i % 2), 0.05 + 0.045 * i});
    EXPECT_EQ(w.world.add(spec), i);
    placed_j += box.rigid.mass_kg * kGravity * spec.initial.position_m[2];
    spec.fixed = true;
    EXPECT_THROW(w.world.add(spec), InputError) << "inside the one before";
  }
  w.run(1.9);
  EXPECT_NEAR(w.get_energy().given_j, placed_j, 0.02 * placed_j);  // and the work of the grab
  w.world.release(0);
  w.run(6.0);
  EXPECT_LT(w.get_deepest_m(), 1e-4);
  EXPECT_LT(w.get_energy().error_j, 1e-5);
  BodySpec shelf = make_body("shelf", slab, {0, 0, 1.0});
  shelf.fixed = true;
  EXPECT_EQ(w.world.add(shelf), 13);
  BodySpec on_it = make_body("on it", box, {0, 0, 1.1});
  EXPECT_EQ(w.world.add(on_it), 14);
  w.world.push(14, {0, 0, 1.1}, {0, 0, -0.01});
  w.run(7.0);
  EXPECT_NEAR(w.last[14].position_m[2], 1.035, 1e-4);
  w.world.remove(13);
  w.run(8.0);
  EXPECT_LT(w.last[14].position_m[2], 0.9);
  BodySpec bad = make_body("bad", box, {0, 0, 3});
  bad.restitution = 2.0;
  EXPECT_THROW(w.world.add(bad), InputError);
  bad.restitution = 0.5;
  bad.bank = nullptr;
  EXPECT_THROW(w.world.add(bad), InputError);
}

TEST(Add, AbsentBodyAndItsErrors) {
  const bank::Bank box = make_box({0.06, 0.05, 0.04});
  BodySpec later = make_body("later", box, {0, 0, 0.02});
  later.absent = true;
  Watched w(make_floor({make_body("box", box, {0, 0, 0.02}), later}));
  w.run(0.5);
  EXPECT_EQ(w.get_energy().given_j, 0.0);
  EXPECT_THROW(w.world.add(1, {.pose = {.position_m = {0.01, 0, 0.05}}}), InputError) << "inside the other";
  EXPECT_THROW(w.world.add(1, {.pose = {.position_m = {1, 0, 0.01}}}), InputError) << "inside the ground";
  EXPECT_THROW(w.world.add(1, {.pose = {.position_m = {std::nan(""), 0, 1}}}), InputError);
  EXPECT_THROW(w.world.add(0, {}), InputError) << "is there";
  EXPECT_THROW(w.world.add(2, {}), InputError);
  EXPECT_THROW(w.world.remove(1), InputError);
  EXPECT_THROW(w.world.drag(0, {}), InputError) << "not held";
  EXPECT_THROW(w.world.grab(0, {}, {.frequency_hz = 0.0}), InputError);
  EXPECT_THROW(w.world.push(-1, {}, {}), InputError);
  EXPECT_THROW(w.world.push(0, {0, 0, 0}, {kForever, 0, 0}), InputError);
  EXPECT_TRUE(w.world.is_absent(1));
  w.world.add(1, {.pose = {.position_m = {0, 0, 0.1}}, .velocity_m_s = {0, 0, -1}});
  w.run(1.5);
  EXPECT_NEAR(w.last[1].position_m[2], 0.06, 1e-4);
  EXPECT_GT(w.hits, 0);
  EXPECT_LT(w.get_energy().error_j, 1e-6);
  WorldSpec tied = make_floor({later});
  tied.cords = {{.body = 0, .to = -1, .from_m = {0, 0, 0.04}, .to_m = {0, 0, 0.5}}};
  EXPECT_THROW(World{tied}, InputError);
}

TEST(Handling, HugeNumbersAreRefused) {
  const bank::Bank box = make_box({0.06, 0.05, 0.04});
  BodySpec later = make_body("later", box, {0, 0, 0.02});
  later.absent = true;
  Watched w(make_floor({make_body("box", box, {0, 0, 0.02}), later}));
  w.run(0.1);
  const double mass_kg = box.rigid.mass_kg;
  const Vec3 centre = w.world.get_centre(0);
  for (const double huge : {1e5, 1e12, 1e300}) {
    EXPECT_THROW(w.world.push(0, centre, {0, 0, mass_kg * huge}), InputError) << huge;
    EXPECT_THROW(w.world.push(0, {huge, 0, 0.02}, {0, 0, mass_kg}), InputError) << huge;
    EXPECT_THROW(w.world.push(0, {9e3, 0, 0.02}, {0, 0, mass_kg}), InputError) << "turns too fast";
    EXPECT_THROW(w.world.grab(0, {huge, 0, 0.02}), InputError) << huge;
    EXPECT_THROW(w.world.grab(0, {5, 0, 0.02}), InputError) << "far outside";
    EXPECT_THROW(w.world.add(1, {.pose = {.position_m = {huge, 0, 1}}}), InputError) << huge;
    EXPECT_THROW(w.world.add(1, {.pose = {.position_m = {0, 0, 1}}, .velocity_m_s = {huge, 0, 0}}), InputError) << huge;
    EXPECT_THROW(w.world.add(1, {.pose = {.position_m = {0, 0, 1}}, .angular_velocity_rad_s = {huge, 0, 0}}), InputError) << huge;
    BodySpec fast = make_body("fast", box, {0, 0, 1});
    fast.angular_velocity_rad_s = {0, huge, 0};
    EXPECT_THROW(w.world.add(fast), InputError) << huge;
  }
  int pushes = 0;
  const auto push_on = [&] {
    for (; pushes < 10; ++pushes) w.world.push(0, w.world.get_centre(0), {0, 0, mass_kg * 120});
  };
  EXPECT_THROW(push_on(), InputError) << "pushes add up";
  EXPECT_EQ(pushes, 2);
  w.world.push(0, w.world.get_centre(0), {0, 0, -mass_kg * 299});
  w.world.grab(0, w.world.get_centre(0));
  EXPECT_THROW(w.world.drag(0, {0, 1e300, 0}), InputError);
  w.run(0.2);
  EXPECT_TRUE(is_finite(w.world.get_centre(0)));
}

TEST(Handling, SameBitsHoweverTimeIsDivided) {
  const bank::Bank box = make_box({0.06, 0.05, 0.04});
  const WorldSpec spec = make_floor({make_body("a", box, {0, 0, 0.1}), make_body("b", box, {0.02, 0.01, 0.2})});
  std::vector<Vec3> ends;
  for (const bool is_divided : {false, true}) {
    World world(spec);
    Vec3 last{};
    const auto take = [&](const events::Event& event) {
      if (const auto* motion = std::get_if<events::BodyMotion>(&event)) last = last + motion->position_m;
    };
    const auto go = [&](double until_s) {
      while (world.advance(until_s, is_divided ? 0.0 : kForever, take) < until_s - 1e-6) {
      }
    };
    go(0.3);
    world.grab(0, {0.0, 0.0, 0.03});
    world.drag(0, {0.1, 0.1, 0.3}, 0.2);
    go(0.6);
    world.remove(1);
    world.push(0, {0, 0, 0.1}, {0.1, 0, 0});
    go(1.0);
    ends.push_back(last);
  }
  EXPECT_EQ(ends[0], ends[1]);
}

TEST(AllowModalImpacts, RigidOnesLoseTheEnergyThatModesTake) {
  const bank::Bank plate = make_plate_bank(0.2, 2e-3, 8000.0, 8, 1.0);
  for (const bool may_begin : {true, false}) {
    Watched w(make_floor({make_body("plate", plate, {0, 0, 0.1}, 1.0)}));
    w.world.allow_modal_impacts(may_begin);
    w.run(0.16);
    EXPECT_EQ(w.world.get_statistics().contacts.longest_impact_s > 0.0, may_begin);
    EXPECT_GT(w.hits, 0);
    EXPECT_LT(w.get_energy().error_j, 1e-3 * w.get_energy().start_j);
    const double rebound = w.last[0].velocity_m_s[2];
    EXPECT_LT(rebound, 1.2) << "restitution 1, but modes took of 1.4 m/s";
  }
}

class RandomHandling : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Seeds, RandomHandling, testing::Range(0, 24));

TEST_P(RandomHandling, StaysFiniteAndApart) {
  const bool has_modes = GetParam() % 2 == 1;
  const bank::Bank box = add_modes(make_box({0.06, 0.05, 0.04}), has_modes ? 12 : 0), ball = make_ball(0.03, 3),
                   plate = make_box({0.12, 0.1, 0.008}), slab = make_box({0.4, 0.4, 0.05});
  const std::vector<const bank::Bank*> kinds{&box, &ball, &plate};
  std::vector<BodySpec> bodies;
  for (int i = 0; i < 6; ++i) bodies.push_back(make_body("body " + std::to_string(i), *kinds[i % 3], {0.15 * i - 0.4, 0, 0.3}));
  bodies.push_back(make_body("slab", slab, {0, 0, 0.1}));
  bodies.back().fixed = true;
  Watched w(make_floor(bodies));
  std::mt19937 random(7 * GetParam() + 1);
  std::uniform_real_distribution<double> unit(-1.0, 1.0);
  const auto draw = [&](double size) { return Vec3{size * unit(random), size * unit(random), size * unit(random)}; };
  int refused = 0, done = 0;
  for (double time_s = 0.0; time_s < 4.0; time_s += 0.05) {
    w.run(time_s);
    const int body = static_cast<int>(random() % 7);
    const Vec3 at = w.last[body].position_m + draw(0.03);
    try {
      switch (random() % 7) {
        case 0:
          w.world.push(body, at, draw(0.3));
          break;
        case 1:
          w.world.grab(body, at, {.frequency_hz = 3.0 + 2.0 * unit(random), .damping_ratio = 0.7});
          break;
        case 2:
        case 3:
          w.world.drag(body, draw(0.4), 0.2 + 0.19 * unit(random));
          break;
        case 4:
          w.world.release(body);
          break;
        case 5:
          w.world.remove(body);
          break;
        default:
          w.world.add(body, {.pose = {.position_m = Vec3{0, 0, 0.4} + draw(0.3)}, .velocity_m_s = body < 6 ? draw(1.0) : Vec3{}});
      }
      ++done;
    } catch (const InputError&) {
      ++refused;
    }
  }
  for (int body = 0; body < 6; ++body)
    if (!w.world.is_absent(body)) w.world.release(body);
  w.run(6.0);
  EXPECT_GT(done, 10);
  EXPECT_GT(refused, 0);
  const ContactAudit contacts = w.world.get_statistics().contacts;
  EXPECT_LT(has_modes ? contacts.unexplained.unexplained_m : contacts.deepest.depth_m, 1e-4);
  EXPECT_LT(w.get_energy().error_j, 2e-3 * w.get_energy().kinetic_j);
}

}  // namespace
}  // namespace carillon::physics::tests
