// Bodies that are moved apart: gaps, the least displacement in closed form, momenta and energy.
#include "runtime/physics/rigid/projection.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "tests/unit/runtime/physics/rigid/drops.hpp"
#include "tests/unit/runtime/physics/rigid/momenta.hpp"
#include "tests/unit/runtime/physics/rigid/stages.hpp"

namespace carillon::rigid {
namespace {

double find_least_gap(const Stages& stages) {
  double gap = 1.0;
  for (const Pair* pair : stages.island.pairs)
    for (const Contact& c : pair->contacts) gap = std::min(gap, c.touch.gap_m);
  return gap;
}

/// A box in any orientation, its lowest corner `depth_m` below the ground.
Stages make_box_in_ground(std::mt19937& random, double depth_m, double speed_m_s) {
  std::normal_distribution<double> normal;
  State s;
  for (double& q : s.rotation) q = normal(random);
  s.rotation = normalise(s.rotation);
  const geometry::tests::Solid box = geometry::tests::make_box(kBoxSides, 1);
  double low = 1.0;
  for (const Vec3& x : box.vertices) low = std::min(low, (make_rotation(s.rotation) * x)[2]);
  s.centre[2] = -low - depth_m;
  for (std::size_t k = 0; k < 3; ++k) s.velocity[k] = speed_m_s * normal(random), s.momentum[k] = 1e-3 * speed_m_s * normal(random);
  return {{make_solid(box, 0.1, kBoxSides)}, {s}, kWood, {0, 0, -kGravity}};
}

TEST(projection, least_displacement_of_corner) {
  std::mt19937 random(3);
  for (int n = 0; n < 100; ++n) {
    const double depth = 1e-4;
    Stages stages = make_box_in_ground(random, depth, 0.0);
    stages.begin({{0, -1}});
    const Pair& pair = *stages.island.pairs[0];
    if (pair.contacts.size() != 1) continue;  // an edge or a side that is nearly level
    const State before = stages.bodies.state(0);
    const Vec3 arm = pair.contacts[0].touch.where_m - before.centre, turning = cross(arm, {0, 0, 1});
    // min 1/2 dx^T M dx with n.(moved + turned x arm) = depth: moved = lambda n / m, turned = lambda I^-1 (arm x n).
    const Vec3 turn = stages.bodies.placed(0).inverse_inertia * turning;
    const double lambda = depth / (1.0 / stages.bodies.solid(0).mass_kg + dot(turning, turn));
    stages.projection.run(stages.step, kMaxDepthM, 0.0);
    const Vec3 moved = stages.bodies.state(0).centre - before.centre;
    EXPECT_NEAR(moved[2], lambda / stages.bodies.solid(0).mass_kg, 1e-3 * depth);
    EXPECT_LT(std::hypot(moved[0], moved[1]), 1e-9);
    EXPECT_GT(find_least_gap(stages), -kDeepM);
    // Nothing moves that could pay for the work.
    EXPECT_NEAR(stages.calc_books().lifted_j, 0.1 * kGravity * moved[2], 1e-12);
  }
}

TEST(projection, work_paid_by_motion) {
  std::mt19937 random(4);
  for (int n = 0; n < 200; ++n) {
    Stages stages = make_box_in_ground(random, 1e-4, n % 2 == 0 ? 1.0 : 1e-3);
    stages.begin({{0, -1}});
    const Books before = stages.calc_books();
    const double kinetic = add_up(stages.bodies).kinetic_j;
    stages.projection.run(stages.step, kMaxDepthM, 0.0);
    EXPECT_GT(find_least_gap(stages), -kMaxDepthM);
    const Books after = stages.calc_books();
    EXPECT_NEAR(after.calc_total(), before.calc_total(), 1e-12 * kinetic + 1e-15);
    EXPECT_GE(after.lifted_j, 0.0);
    EXPECT_LE(after.motion_j, before.motion_j + after.lifted_j + 1e-15);
    EXPECT_LE(after.lifted_j, n % 2 == 0 ? 1e-12 * kinetic : 0.1 * kGravity * 1e-4) << n;
  }
}

// A box at rest is lifted. When it moves on the ground, each step takes at most half of its energy until that is paid; in the air none.
TEST(projection, lift_paid_by_later_motion) {
  std::mt19937 random(8);
  for (int n = 0; n < 20; ++n) {
    Stages stages = make_box_in_ground(random, 1e-4, 0.0);
    stages.begin({{0, -1}});
    stages.bodies.set_time(0.1);
    const double total = stages.calc_books().calc_total();
    stages.projection.run(stages.step, kMaxDepthM, 0.0);
    const double lifted = stages.calc_books().lifted_j;
    ASSERT_GT(lifted, 0.0);
    const double speed = std::sqrt(lifted / 0.1);
    stages.bodies.state(0).velocity = {speed, 0, 0};  // its energy is half of that owed
    stages.bodies.place(0);
    stages.projection.collect(stages.step);
    EXPECT_EQ(stages.bodies.state(0).velocity[0], speed);
    for (Contact& c : stages.island.pairs[0]->contacts) c.touching = true;
    stages.projection.collect(stages.step);
    EXPECT_NEAR(stages.calc_books().lifted_j, 0.75 * lifted, 1e-9 * lifted);
    EXPECT_NEAR(stages.bodies.state(0).velocity[0], std::sqrt(0.5) * speed, 1e-9 * speed);
    stages.bodies.state(0).velocity = {10.0 * speed, 0, 0};
    stages.bodies.place(0);
    for (int again = 0; again < 2; ++again) stages.projection.collect(stages.step);
    const Books books = stages.calc_books();
    EXPECT_NEAR(books.lifted_j, 0.0, 1e-9 * lifted);
    EXPECT_NEAR(books.calc_total(), total + 0.05 * (100.0 + 0.5) * speed * speed, 1e-12 * std::abs(total) + 1e-9 * lifted);
  }
}

TEST(projection, momenta_of_separated_free_bodies) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (int n = 0; n < 50; ++n) {
    const double overlap = 1e-4;
    std::vector<State> states{make_state({0, 0, 0}), make_state({kBoxSides[0] - overlap, 0, 0})};
    for (State& s : states)
      for (std::size_t k = 0; k < 3; ++k) s.velocity[k] = normal(random), s.momentum[k] = 1e-3 * normal(random);
    Stages stages({make_box(0.1, kBoxSides), make_box(0.3, kBoxSides)}, states, std::nullopt, {});
    stages.begin({{0, 1}});
    const Momenta before = add_up(stages.bodies);
    const double total = stages.calc_books().calc_total();
    stages.projection.run(stages.step, kMaxDepthM, 0.0);
    EXPECT_GT(find_least_gap(stages), -kDeepM);
    EXPECT_NEAR(stages.bodies.state(0).centre[0], -0.75 * overlap, 1e-3 * overlap);
    EXPECT_NEAR(stages.bodies.state(1).centre[0] - states[1].centre[0], 0.25 * overlap, 1e-3 * overlap);
    const Momenta after = add_up(stages.bodies);
    EXPECT_LT(norm(after.linear - before.linear), 1e-13);
    EXPECT_LT(norm(after.angular - before.angular), 1e-13);
    EXPECT_NEAR(stages.calc_books().calc_total(), total, 1e-13);
  }
}

TEST(projection, permitted_depth_unchanged) {
  std::mt19937 random(6);
  for (const double allowed : {0.0, 1e-4}) {
    Stages stages = make_box_in_ground(random, 1e-4, 1.0);
    stages.begin({{0, -1}});
    stages.island.pairs[0]->sag_m = allowed;
    const Vec3 before = stages.bodies.state(0).centre;
    stages.projection.run(stages.step, kMaxDepthM, 0.0);
    EXPECT_EQ(stages.bodies.state(0).centre == before, allowed > 0.0);
    EXPECT_EQ(stages.ledger.costs.pushes > 0, allowed == 0.0);
  }
}

TEST(projection, touches_of_the_displaced_body) {
  // An edge from below lifts one side of a lying coin by 0.3 mm; about its centre of mass the other side would turn 0.18 mm into the
  // ground, where it had no touch.
  const tests::DropBody coin = tests::make_drop_body(1, 0);
  Solid block = make_box(1.0, {0.01, 0.04, 0.02});
  block.fixed = true;
  State lying, below;
  lying.centre = {0, 0, 1e-3};
  below.centre = {0.014, 0, 3e-4 - 0.01};
  Stages stages({coin.solid, block}, {lying, below}, kWood, {0, 0, -kGravity});
  stages.begin({{0, -1}, {0, 1}});
  stages.island.pairs[0]->contacts.clear();
  stages.projection.run(stages.step, kMaxDepthM, 0.0);
  const auto find_lowest = [&](double from_m) {
    double low = 1.0;
    for (const Vec3& x : coin.vertices)
      if (x[0] >= from_m) low = std::min(low, stages.bodies.state(0).centre[2] + (stages.bodies.placed(0).rotation * x)[2]);
    return low;
  };
  EXPECT_GT(find_lowest(-1.0), -kMaxDepthM - kMissingDepthM);
  EXPECT_GT(find_lowest(0.009), 3e-4 - 2.0 * kMaxDepthM);
}

TEST(projection, lift_by_impact_springs) {
  std::mt19937 random(7);
  Stages stages = make_box_in_ground(random, 1e-4, 0.0);
  stages.begin({{0, -1}});
  stages.touches.release(0, -1, 0.0, 1.0);
  const double total = stages.calc_books().calc_total();
  stages.projection.run(stages.step, kMaxDepthM, 0.0);
  const Books books = stages.calc_books();
  EXPECT_GT(find_least_gap(stages), -kMaxDepthM);
  EXPECT_EQ(books.lifted_j, 0.0);
  EXPECT_LT(books.springs_j, 1.0);
  EXPECT_EQ(books.lost_j, 0.0);
  EXPECT_NEAR(books.calc_total(), total, 1e-13);
}

}  // namespace
}  // namespace carillon::rigid
