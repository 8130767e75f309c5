// Hard cases of depth: chains of rings that must hold, a heap of curved bodies, and a heavy load on a light cup.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <memory>
#include <numbers>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "tests/hard/contact_course.hpp"
#include "tests/hard/figure.hpp"
#include "tests/unit/runtime/physics/rigid/drops.hpp"

namespace carillon::hard {
namespace {

constexpr double kWindow = 2e-3;  // s

/// Rings that hang in each other, the first of them fixed, let go as a horizontal row.
void swing(const std::string& id, int count, double seconds) {
  constexpr double kRadius = 0.02, kWire = 0.003, kInner = 2.0 * (kRadius - kWire);
  const bank::Bank ring = make_bank(geometry::tests::make_ring(kRadius, kWire, 48, 16), 7800.0);
  const double q = std::sqrt(0.5);
  WorldSpec spec;
  for (int i = 0; i < count; ++i) {
    spec.bodies.push_back(make_body(ring, {(kInner - 2e-4) * i, 0, 0}));
    if (i % 2 != 0) spec.bodies.back().initial.rotation = {q, q, 0, 0};
  }
  spec.bodies.front().fixed = true;
  World world(spec, {.end_s = seconds, .modes = false, .lasting_contacts = false, .audits_energy = true});
  std::vector<Vec3> at(spec.bodies.size());
  double apart_m = 0.0;
  world.advance(seconds, std::numeric_limits<double>::infinity(), [&](const events::Event& event) {
    // Bodies are all known at the ends of windows.
    if (const auto* m = std::get_if<events::BodyMotion>(&event);
        m != nullptr && std::abs(m->time_s / kWindow - std::round(m->time_s / kWindow)) < 1e-9)
      at[m->body] = m->position_m;
    if (std::holds_alternative<events::TimeWatermark>(event))
      for (std::size_t i = 1; i < at.size(); ++i) apart_m = std::max(apart_m, norm(at[i] - at[i - 1]) - kInner);
  });
  const physics::Statistics statistics = world.get_statistics();
  hold(id, apart_m, 5e-5, "distance of neighbours beyond the inner width [m]");
  hold(id, statistics.contacts.deepest.depth_m, 6e-5, "deepest in each other ever [m]");
  hold(id, statistics.energy.lifted_j / statistics.energy.kinetic_j, 1e-3, "energy lifted over the largest of motion");
  hold(id, statistics.energy.error_j / statistics.energy.kinetic_j, 1e-3, "energy not accounted for over the largest of motion");
}

TEST(depth, chain_of_3) { swing("chain_of_3", 3, 5.0); }
TEST(depth, chain_of_6) { swing("chain_of_6", 6, 5.0); }
TEST(depth, chain_of_12) { swing("chain_of_12", 12, 5.0); }

/// Coins, rings, cups and bowls that fall into a box. `fine`: of their facets; where two smooth surfaces touch, facets of the hollow one
/// are up to 0.24 mm in the other at 1, 0.03 mm at 3.
void heap(const std::string& id, int count, int fine, double end_s, double awake_bound_s, double rolling_resistance) {
  std::vector<bank::Bank> banks;
  for (const int kind : {1, 2, 5, 6}) banks.push_back(make_bank(rigid::tests::make_drop_surface(kind, fine), 2500.0));
  const bank::Bank wall = make_dense_box({0.42, 0.02, 0.6}, 2700.0);
  WorldSpec spec;
  spec.ground = GroundSpec{};
  for (int i = 0; i < count; ++i) {
    const bank::Bank& bank = banks[(i + i / 4) % 4];
    spec.bodies.push_back(make_body(
        bank, {0.09 * (i / 2 % 2 != 0 ? 1 : -1) + 0.002 * (i % 5), 0.09 * (i % 2 != 0 ? 1 : -1) - 0.001 * (i % 7), 0.12 + 0.17 * (i / 4)}));
    const double half = 0.5 * (0.3 + 0.7 * i);
    spec.bodies.back().initial.rotation = {std::cos(half), 0.6 * std::sin(half), 0, 0.8 * std::sin(half)};
    spec.bodies.back().rolling_resistance = rolling_resistance;
  }
  const double q = std::sqrt(0.5);
  for (const double side : {-0.2, 0.2})
    for (const bool is_turned : {false, true}) {
      spec.bodies.push_back(make_body(wall, is_turned ? Vec3{side, 0, 0.3} : Vec3{0, side, 0.3}));
      spec.bodies.back().fixed = true;
      if (is_turned) spec.bodies.back().initial.rotation = {q, 0, 0, q};
    }
  World world(spec, {.end_s = end_s, .modes = false, .lasting_contacts = false, .audits_energy = true});
  std::vector<events::BodyMotion> at(spec.bodies.size());
  double awake_s = 0.0;
  std::int64_t steps = 0;
  for (int n = 1; n <= 60; ++n) {
    world.advance(end_s * n / 60, std::numeric_limits<double>::infinity(), [&](const events::Event& event) {
      if (const auto* m = std::get_if<events::BodyMotion>(&event)) at[m->body] = *m;
    });
    if (std::exchange(steps, world.get_statistics().steps) != steps) awake_s = end_s * n / 60;
  }
  double in_ground_m = 0.0, in_bodies_m = 0.0;
  std::vector<std::unique_ptr<geometry::Shape>> shapes;
  std::vector<geometry::Frame> frames;
  for (std::size_t i = 0; i < at.size(); ++i) {
    const bank::Bank& bank = *spec.bodies[i].bank;
    shapes.push_back(std::make_unique<geometry::Shape>(bank.vertices_m, bank.triangles));
    const physics::Pose pose = physics::calc_pose(at[i], bank.rigid.centre_m);
    frames.push_back({rigid::make_rotation(pose.rotation), pose.position_m});
    if (!spec.bodies[i].fixed) in_ground_m = std::max(in_ground_m, calc_depth(bank, at[i]));
    for (std::size_t k = 0; k < i; ++k) {
      Vec3 where{};
      if (!spec.bodies[i].fixed || !spec.bodies[k].fixed)
        in_bodies_m = std::max(in_bodies_m, geometry::calc_overlap(*shapes[k], frames[k], *shapes[i], frames[i], where));
    }
  }
  const physics::Statistics statistics = world.get_statistics();
  hold(id, in_ground_m, 1e-4, "in the ground at the end [m]");
  hold(id, in_bodies_m, 1e-4, "in each other at the end [m]");
  hold(id, statistics.contacts.deepest.depth_m, 1e-4, "deepest ever [m]");
  hold(id, awake_s, awake_bound_s, "last moment awake [s]");
  hold(id, statistics.energy.lifted_j / statistics.energy.kinetic_j, 2e-3, "energy lifted over the largest of motion");
}

TEST(depth, heap) { heap("heap", 12, 3, 6.0, 6.0, 1e-3); }  // a bowl rocks on
TEST(depth, heap_of_30) { heap("heap_of_30", 30, 2, 5.1, 5.0, 5e-3); }

// 390 times as heavy as the cup, which stands upright or upside down.
TEST(depth, loaded_cup) {
  const bank::Bank cup = make_bank(rigid::tests::make_drop_surface(5), 2500.0), block = make_dense_box({0.2, 0.2, 0.2}, 7875.0);
  double rests_m = 0.0, falls_m = 0.0, error = 0.0;
  for (const bool is_upright : {true, false})
    for (const double tilt_deg : {0.0, 0.5, 2.0}) {
      const double half = tilt_deg * std::numbers::pi / 360.0, low_m = 0.1 * (std::cos(2.0 * half) + std::sin(2.0 * half));
      WorldSpec spec;
      spec.ground = GroundSpec{};
      spec.bodies = {make_body(cup, {0, 0, is_upright ? 1e-5 : 0.09 + 1e-5}), make_body(block, {0.003, 0.002, 0.09 + low_m + 1e-3})};
      if (!is_upright) spec.bodies.front().initial.rotation = {0, 1, 0, 0};
      spec.bodies.back().initial.rotation = {std::cos(half), std::sin(half), 0, 0};
      World world(spec, {.end_s = 3.0, .modes = false, .lasting_contacts = false, .audits_energy = true});
      events::BodyMotion load;
      world.advance(3.0, std::numeric_limits<double>::infinity(), [&](const events::Event& event) {
        if (const auto* m = std::get_if<events::BodyMotion>(&event); m != nullptr && m->body == 1) load = *m;
      });
      const physics::Statistics statistics = world.get_statistics();
      rests_m = std::max(rests_m, statistics.contacts.now.depth_m);
      error = std::max(error, statistics.energy.error_j / statistics.energy.kinetic_j);
      falls_m = std::max(falls_m, std::abs(physics::calc_pose(load, block.rigid.centre_m).position_m[2] - 0.19));
    }
  hold("loaded_cup", rests_m, 5e-5, "deepest at the end [m]");
  hold("loaded_cup", falls_m, 5e-5, "height of the load at the end, off that of the cup and half of its own [m]");
  hold("loaded_cup", error, 1e-3, "energy not accounted for over the largest of motion");
}

}  // namespace
}  // namespace carillon::hard
