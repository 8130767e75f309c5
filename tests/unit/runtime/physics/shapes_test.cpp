// Surfaces as real banks have them: pinched vertices, hollows, ears, many small edges.
#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/runtime/physics/checks.hpp"
#include "tests/unit/runtime/physics/solids.hpp"

namespace carillon::physics::tests {
namespace {

WorldSpec make_fall(const bank::Bank& bank, double height_m, double restitution = 0.4) {
  WorldSpec w;
  w.ground = GroundSpec{};
  w.ground->restitution = restitution;
  w.bodies.resize(1);
  w.bodies[0].name = "body";
  w.bodies[0].bank = &bank;
  w.bodies[0].restitution = restitution;
  w.bodies[0].initial.position_m = {0, 0, height_m};
  return w;
}

/// Two cubes glued in one corner (two pieces, one vertex), and a ring of cubes whose ends meet in one corner (one piece, pinched).
class Pinched : public testing::TestWithParam<std::vector<std::array<int, 3>>> {};
INSTANTIATE_TEST_SUITE_P(Bodies, Pinched,
                         testing::Values(std::vector<std::array<int, 3>>{{0, 0, 0}, {1, 1, 1}},
                                         std::vector<std::array<int, 3>>{
                                             {0, 0, 0}, {-1, 0, 0}, {-1, 1, 0}, {-1, 1, 1}, {-1, 2, 1}, {0, 2, 1}, {1, 2, 1}, {1, 1, 1}}));

TEST_P(Pinched, SoundOfPinchedBody) {
  const bank::Bank bank = make_cells(GetParam(), 0.02);
  const double height = 0.2;
  const Simulation s = simulate(make_fall(bank, height), 0.22);
  ASSERT_FALSE(s.impulses.empty());
  double push = 0.0;
  for (const Impulse& p : s.impulses) {
    ASSERT_GE(p.triangle, 0);
    ASSERT_LT(p.triangle, static_cast<int>(bank.triangles.size()));
    EXPECT_NEAR(point_on_body(bank, p)[2], 0.0, 1e-9) << "the underside is struck";
    if (p.time_s < std::sqrt(2 * height / 9.81) + 2e-3) push += p.impulse_n_s[2];
  }
  EXPECT_NEAR(s.impulses[0].time_s - 0.5 * s.impulses[0].duration_s, std::sqrt(2 * height / 9.81), 1e-5);
  EXPECT_GT(push, 0.3 * bank.rigid.mass_kg * std::sqrt(2 * 9.81 * height));
}

TEST(FlatBody, CornerHitsForAnyMesh) {
  std::vector<Simulation> runs;
  for (const int cells : {1, 7}) {
    const bank::Bank box = make_box({0.1, 0.06, 0.04}, {cells, cells, cells});
    runs.push_back(simulate(make_fall(box, 0.22), 0.5));
    for (const Impulse& p : runs.back().impulses) {
      const Vec3 x = point_on_body(box, p);
      EXPECT_NEAR(std::abs(x[0]), 0.05, 1e-6);
      EXPECT_NEAR(std::abs(x[1]), 0.03, 1e-6);
    }
  }
  ASSERT_EQ(runs[0].impulses.size(), runs[1].impulses.size());
  for (std::size_t i = 0; i < runs[0].impulses.size(); ++i) EXPECT_NEAR(runs[0].impulses[i].time_s, runs[1].impulses[i].time_s, 2e-4);
}

TEST(FlatBody, RestAcrossNarrowShelf) {
  // A cross: no corner of one is over the other; only their edges cross. With six cells they cross exactly where the next edge begins.
  for (const int cells : {1, 5, 6}) {
    const bank::Bank across = make_box({0.3, 0.06, 0.02}, {cells, cells, 1}), along = make_box({0.06, 0.3, 0.02}, {cells, cells, 1});
    WorldSpec w = make_fall(across, 0.12);
    w.bodies.push_back(w.bodies[0]);
    w.bodies[1].name = "shelf";
    w.bodies[1].bank = &along;
    w.bodies[1].fixed = true;
    w.bodies[1].initial.position_m = {};
    w.ground.reset();
    const Simulation s = simulate(w, 0.6);
    double push = 0.0;
    for (const Impulse& p : s.impulses) {
      if (p.body == 0 && p.time_s < std::sqrt(2 * 0.1 / 9.81) + 2e-3) push += p.impulse_n_s[2];
    }
    EXPECT_NEAR(push, 1.4 * across.rigid.mass_kg * std::sqrt(2 * 9.81 * 0.1), 1e-3) << cells;
    EXPECT_NEAR(s.poses[0].back().position_m[2], 0.02, 1e-4) << cells;
  }
}

struct Fall {
  double restitution, friction;
  std::array<double, 4> rotation;
  Vec3 spin;
};

/// How deep the path takes any vertex into the plate (half thicknesses, at the origin) and the ground.
double calc_deepest(const bank::Bank& bank, const std::vector<Pose>& path, const Vec3& half, double plate_turn, double ground_m) {
  double deepest = 0.0;
  for (const Pose& pose : path) {
    for (const auto& x : bank.vertices_m) {
      const Vec3 world = pose.position_m + rotate(pose.rotation, x);
      deepest = std::max(deepest, ground_m - world[2]);
      const Vec3 in = rotate({std::cos(plate_turn / 2), 0, -std::sin(plate_turn / 2), 0}, world);
      deepest = std::max(deepest, std::min({half[0] - std::abs(in[0]), half[1] - std::abs(in[1]), half[2] - std::abs(in[2])}));
    }
  }
  return deepest;
}

class EaredBall : public testing::TestWithParam<Fall> {};
INSTANTIATE_TEST_SUITE_P(Falls, EaredBall,
                         testing::Values(Fall{0.3, 0.3, {1, 0, 0, 0}, {0, 0, 0}}, Fall{0.0, 1.0, {0.1, 0.9, 0.3, 0.1}, {5, -3, 2}},
                                         Fall{0.8, 0.1, {0.4, -0.2, 0.9, 0.3}, {-8, 4, 9}}, Fall{0.3, 0.0, {0, 0, 1, 0}, {0, 20, 0}}));

TEST_P(EaredBall, TumblingWithoutPenetrationOrEnergyGain) {
  const Fall& fall = GetParam();
  const bank::Bank bank = make_eared_ball(0.04, 5);
  const Vec3 plate{0.3, 0.2, 0.008};
  const bank::Bank shelf = make_box(plate, {15, 10, 1});
  const double turn = 0.4, ground = -0.25;
  WorldSpec w = make_fall(bank, 0.18, fall.restitution);
  w.ground->height_m = ground;
  w.bodies[0].friction = w.ground->friction = fall.friction;
  w.bodies[0].initial.rotation = fall.rotation;
  w.bodies[0].angular_velocity_rad_s = fall.spin;
  w.bodies.push_back(w.bodies[0]);
  w.bodies[1].name = "shelf";
  w.bodies[1].bank = &shelf;
  w.bodies[1].fixed = true;
  w.bodies[1].angular_velocity_rad_s = {};
  w.bodies[1].initial.position_m = {};
  w.bodies[1].initial.rotation = {std::cos(turn / 2), 0, std::sin(turn / 2), 0};
  const Simulation s = simulate(w, 1.0);
  EXPECT_LT(calc_deepest(bank, s.poses[0], 0.5 * plate, turn, ground), 3e-4);
  int on_shelf = 0, on_ground = 0;
  for (const Impulse& p : s.impulses) {
    if (p.body == 0) ++(p.other == 1 ? on_shelf : on_ground);
  }
  EXPECT_GT(on_shelf, 0);
  EXPECT_GT(on_ground, 0);
  EXPECT_LT(s.impulses.size(), 300U) << "a buzz";
  double min = 1e9;
  for (const EnergySample& e : calc_energies(bank, s.poses[0], 9.81)) {
    const auto strikes = [&](const Impulse& p) { return std::abs(p.time_s - 0.5 * p.duration_s - e.time_s) < 4e-3; };
    if (std::any_of(s.impulses.begin(), s.impulses.end(), strikes)) continue;  // the difference straddles a jump
    EXPECT_LT(e.energy_j, min + 2e-3 * bank.rigid.mass_kg * 9.81 * 0.4) << "at " << e.time_s;
    min = std::min(min, e.energy_j);
  }
}

}  // namespace
}  // namespace carillon::physics::tests
