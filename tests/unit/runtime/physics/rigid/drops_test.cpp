// The touches of a body and the floor against all its vertices, after every step of random drops.
#include "tests/unit/runtime/physics/rigid/drops.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <random>
#include <string>
#include <utility>
#include <vector>

namespace carillon::rigid::tests {
namespace {

TEST(drops, complete_floor_touches_at_end_of_steps) {
  std::mt19937 random(3);
  for (int n = 0; n < 24; ++n) {
    std::array<std::uint8_t, 16> bytes{};
    for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random() & 255U);
    bytes[0] = static_cast<std::uint8_t>(n);  // each body twice
    const Drop drop = decode_drop(bytes);
    SCOPED_TRACE(kDropBodies.at(drop.body));
    EXPECT_LE(run_drop(drop, 0.5).missed_m, 2e-6 + 1e-9);
  }
}

// One side lands and throws the other down within a step: its touch is missing at the beginning of the step. Before added touches were
// kept these drops were 70 to 170 um deep; the rods, whose one touch jumped from end to end, 130 and 200 um.
TEST(drops, depth_of_far_side_at_landing) {
  const std::array<std::uint8_t, 16> drops[] = {{0, 222, 225, 252, 142, 195, 61, 83, 236, 253, 11, 205, 5, 84, 11, 2},
                                                {1, 61, 195, 86, 73, 51, 37, 146, 193, 47, 128, 220, 44, 240, 173, 107},
                                                {3, 13, 237, 200, 189, 117, 148, 9, 226, 122, 142, 220, 79, 47, 157, 150},
                                                {3, 219, 136, 9, 75, 251, 249, 84, 43, 26, 109, 66, 26, 106, 147, 199},
                                                {5, 41, 161, 54, 81, 152, 214, 13, 233, 208, 243, 235, 209, 15, 206, 188},
                                                {5, 127, 152, 73, 191, 187, 122, 49, 35, 207, 104, 68, 244, 14, 103, 117},
                                                {6, 199, 100, 232, 232, 243, 184, 109, 156, 237, 71, 93, 117, 136, 155, 234},
                                                {6, 93, 212, 60, 244, 55, 223, 9, 55, 1, 158, 65, 160, 57, 7, 124}};
  for (const auto& bytes : drops) {
    const DropOutcome outcome = run_drop(decode_drop(bytes), 1.0);
    EXPECT_LE(outcome.deepest_m, calc_allowed_depth(outcome)) << kDropBodies.at(bytes[0]);
  }
}

// Discs and coins just above the floor that cups and boxes strike down. One coin was 0.53 mm deep before the floor was met in the step of a
// strike that made it reachable, one disc 0.09 mm before steps that end deep were halved where nothing strikes.
TEST(drops, depth_of_bodies_struck_above_the_floor) {
  std::mt19937 random(11);
  const auto draw = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
  const auto draw_turn = [&] {
    std::normal_distribution<double> normal;
    Quaternion q{normal(random), normal(random), normal(random), normal(random)};
    const double size = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
    for (double& x : q) x /= size;
    return q;
  };
  std::map<int, DropBody> bodies;
  for (const int kind : {0, 1, 5, 11}) bodies.emplace(kind, make_drop_body(kind, 0));
  int struck = 0;
  for (int n = 0; n < 600; ++n) {
    const int kinds[] = {n % 2, n % 4 < 2 ? 5 : 11};
    std::vector<Solid> solids;
    std::vector<State> states;
    std::vector<std::vector<Vec3>> vertices;
    double low_m = draw(2e-4, 5e-4);
    for (const int kind : kinds) {
      DropBody& body = bodies.at(kind);
      body.solid.restitution = draw(0.0, 0.9);
      body.solid.friction = draw(0.1, 1.0);
      State at;
      at.rotation = draw_turn();
      const Mat3 rotation = make_rotation(at.rotation);
      double lowest = 1.0, highest = -1.0;
      for (const Vec3& x : body.vertices) {
        lowest = std::min(lowest, (rotation * x)[2]);
        highest = std::max(highest, (rotation * x)[2]);
      }
      at.centre = {draw(-0.012, 0.012), draw(-0.012, 0.012), low_m - lowest};
      low_m = at.centre[2] + highest + draw(1e-4, 2e-3);
      if (!solids.empty()) at.velocity = {0, 0, draw(-2.5, -1.0)};
      solids.push_back(body.solid);
      states.push_back(at);
      vertices.push_back(body.vertices);
    }
    Space space(std::move(solids), std::move(states), Ground{0.0, 0.5, 0.5, 30e9, 0.2}, {0, 0, -9.81}, {});
    const double before_j = space.calc_books().motion_j;
    double deepest_m = 0.0, gained_j = 0.0, kinetic_j = calc_kinetic(space.solid(1), space.state(1));
    while (space.get_time() < 0.02 - 1e-9) {
      space.step(0.02);
      for (int k = 0; k < 2; ++k) {
        const Mat3 r = make_rotation(space.state(k).rotation);
        for (const Vec3& x : vertices[k]) deepest_m = std::max(deepest_m, -(space.state(k).centre + r * x)[2]);
      }
      const Books books = space.calc_books();
      gained_j = std::max(gained_j, books.motion_j - books.lifted_j - before_j);
    }
    struck += space.take_strikes().empty() ? 0 : 1;
    SCOPED_TRACE(std::to_string(n) + ": " + kDropBodies.at(kinds[1]) + " on " + kDropBodies.at(kinds[0]));
    const double thickness_m = std::min(space.solid(0).shape->get_thickness_m(), space.solid(1).shape->get_thickness_m());
    EXPECT_LE(deepest_m, calc_allowed_depth({.thickness_m = thickness_m}));
    EXPECT_LE(gained_j, kWanted.gained * kinetic_j);
    EXPECT_LE(space.calc_books().lifted_j, kWanted.lifted * kinetic_j);
  }
  EXPECT_GT(struck, 550);
}

/// Overlap of two boxes by the separating axis theorem: S. Gottschalk, M. Lin and D. Manocha (SIGGRAPH 1996). Negative: they are apart.
double calc_overlap(const Space& space, const std::array<Vec3, 2>& sizes_m) {
  std::array<Mat3, 2> axes;  // rows
  for (int k : {0, 1}) axes[k] = transpose(make_rotation(space.state(k).rotation));
  const Vec3 between = space.state(1).centre - space.state(0).centre;
  double least_m = 1.0;
  const auto test = [&](const Vec3& n) {
    double overlap_m = -std::abs(dot(n, between));
    for (int k : {0, 1})
      for (int i = 0; i < 3; ++i) overlap_m += 0.5 * sizes_m[k][i] * std::abs(dot(n, axes[k][i]));
    least_m = std::min(least_m, overlap_m);
  };
  for (int i = 0; i < 3; ++i) {
    test(axes[0][i]);
    test(axes[1][i]);
    for (int j = 0; j < 3; ++j)
      if (const Vec3 n = cross(axes[0][i], axes[1][j]); norm(n) > 1e-6) test((1.0 / norm(n)) * n);
  }
  return least_m;
}

/// Momentum of two bodies, and angular momentum about the origin.
std::pair<Vec3, Vec3> calc_momentum(const Space& space) {
  Vec3 push{}, spin{};
  for (int k : {0, 1}) {
    const State& s = space.state(k);
    const Vec3 own = space.solid(k).mass_kg * s.velocity;
    push = push + own;
    spin = spin + s.momentum + cross(s.centre, own);
  }
  return {push, spin};
}

Vec3 draw_direction(std::mt19937& random) {
  std::normal_distribution<double> normal;
  const Vec3 x{normal(random), normal(random), normal(random)};
  return (1.0 / norm(x)) * x;
}

// Plates, bars and cubes that turn fast meet in flight with features that no search has found: of these 500 pairs 17 were deeper than 50
// um, one 2.1 mm, before polyhedra were compared at the end of a step.
TEST(drops, depth_of_boxes_that_meet_in_flight) {
  std::mt19937 random(11);
  const auto draw = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
  const Vec3 kinds_m[] = {{0.1, 0.1, 0.003}, {0.04, 0.04, 0.002}, {0.1, 0.02, 0.01}, {0.03, 0.03, 0.03}};
  int struck = 0;
  for (int n = 0; n < 500; ++n) {
    std::vector<Solid> solids;
    std::vector<State> states;
    const std::array<Vec3, 2> sizes_m{kinds_m[n % 4], kinds_m[n / 4 % 4]};
    for (const Vec3& size_m : sizes_m) {
      Solid& s = solids.emplace_back();
      s.shape = geometry::tests::make_box(size_m, 1).make();
      s.mass_kg = 2000.0 * size_m[0] * size_m[1] * size_m[2];
      for (int i = 0; i < 3; ++i) s.inertia_kg_m2[i][i] = s.mass_kg / 12.0 * (dot(size_m, size_m) - size_m[i] * size_m[i]);
      for (int i = 0; i < 3; ++i) s.inverse_inertia[i][i] = 1.0 / s.inertia_kg_m2[i][i];
      s.radius_m = 0.5 * norm(size_m);
      s.young_modulus_pa = 2e11;
      s.poisson_ratio = 0.3;
      s.restitution = draw(0.0, 0.9);
      s.friction = draw(0.1, 1.0);
      State& at = states.emplace_back();
      const Vec3 axis = draw_direction(random);
      const double half = 0.5 * draw(0.0, 2.0 * std::numbers::pi);
      at.rotation = {std::cos(half), std::sin(half) * axis[0], std::sin(half) * axis[1], std::sin(half) * axis[2]};
      const Mat3 rotation = make_rotation(at.rotation);
      at.momentum = rotation * (s.inertia_kg_m2 * (transpose(rotation) * (draw(0.0, 200.0) * draw_direction(random))));
      if (solids.size() == 1) continue;
      const Vec3 from = draw_direction(random);
      at.centre = (solids[0].radius_m + s.radius_m + 1e-3) * from;
      at.velocity = -draw(0.2, 4.0) * from;
    }
    Space space(std::move(solids), std::move(states), std::nullopt, {}, {});
    const double before_j = space.calc_books().motion_j;
    const auto [push, spin] = calc_momentum(space);
    double deepest_m = 0.0;
    while (space.get_time() < 0.08 - 1e-9) {
      space.step(0.08);
      deepest_m = std::max(deepest_m, calc_overlap(space, sizes_m));
    }
    struck += space.take_strikes().empty() ? 0 : 1;
    EXPECT_LE(deepest_m, 5e-5) << n;
    EXPECT_LE(space.calc_books().motion_j, (1.0 + 1e-6) * before_j) << n;
    const auto [push_after, spin_after] = calc_momentum(space);
    EXPECT_LE(norm(push_after - push), 1e-10 * norm(push)) << n;
    EXPECT_LE(norm(spin_after - spin), 1e-6 * (norm(spin) + 0.05 * norm(push))) << n;
  }
  EXPECT_GT(struck, 450);
}

/// Two curved bodies that turn and fly towards each other. Largest depth after any step, as a share of the allowed one.
double run_meeting(unsigned seed, bool& has_struck) {
  std::mt19937 random(seed);
  const auto draw = [&](double low, double high) { return std::uniform_real_distribution<double>(low, high)(random); };
  constexpr int kCurved = 7;  // the first of kDropBodies
  std::vector<Solid> solids;
  std::vector<State> states;
  for (int k : {0, 1}) {
    const DropBody body = make_drop_body(static_cast<int>(random() % kCurved), 1);
    State& at = states.emplace_back();
    const Vec3 axis = draw_direction(random);
    const double half = draw(0.0, std::numbers::pi);
    at.rotation = {std::cos(half), std::sin(half) * axis[0], std::sin(half) * axis[1], std::sin(half) * axis[2]};
    const Mat3 rotation = make_rotation(at.rotation);
    at.momentum = rotation * (body.solid.inertia_kg_m2 * (transpose(rotation) * (draw(0.0, 150.0) * draw_direction(random))));
    solids.push_back(body.solid);
    if (k == 0) continue;
    const Vec3 from = draw_direction(random);
    at.centre = (solids[0].radius_m + body.solid.radius_m + 1e-3) * from + draw(0.0, 0.01) * draw_direction(random);
    at.velocity = -draw(0.5, 6.0) * from;
  }
  const double ends_s = 2.0 * norm(states[1].centre) / norm(states[1].velocity);
  Space space(std::move(solids), std::move(states), std::nullopt, {}, {});
  const geometry::Shape &a = *space.solid(0).shape, &b = *space.solid(1).shape;
  const double before_j = space.calc_books().motion_j;
  const auto [push, spin] = calc_momentum(space);
  double deepest_m = 0.0;
  while (space.get_time() < ends_s - 1e-9) {
    space.step(ends_s);
    geometry::PairMemory memory;
    deepest_m = std::max(deepest_m, -geometry::find_deepest(a, space.get_frame(0), b, space.get_frame(1), 0.0, memory).gap_m);
  }
  has_struck = !space.take_strikes().empty();
  EXPECT_LE(space.calc_books().motion_j, (1.0 + 1e-6) * before_j) << seed;
  const auto [push_after, spin_after] = calc_momentum(space);
  EXPECT_LE(norm(push_after - push), 1e-10 * norm(push)) << seed;
  EXPECT_LE(norm(spin_after - spin), 1e-6 * (norm(spin) + 0.05 * norm(push))) << seed;
  return deepest_m / calc_allowed_depth({.thickness_m = std::min(a.get_thickness_m(), b.get_thickness_m())});
}

// Of 3,000 such pairs 34 were up to 12 times deeper than allowed before bodies whose search had found no touch were compared at the end of
// a step; five are now, 1.4 times at most. The seeds of twelve of them, and others.
TEST(drops, depth_of_curved_bodies_that_meet_in_flight) {
  std::vector<unsigned> seeds{1157, 1224, 1329, 1559, 1574, 1727, 1764, 1795, 1880, 1891, 2001, 2003};
  for (unsigned seed = 1; seed <= 20; ++seed) seeds.push_back(seed);
  int struck = 0;
  for (const unsigned seed : seeds) {
    bool has_struck = false;
    EXPECT_LE(run_meeting(seed, has_struck), 1.0) << seed;
    struck += has_struck ? 1 : 0;
  }
  EXPECT_GT(struck, 28);
}

// A cup and a bowl in a bowl that is fixed. Oracle: they fall no higher than they were, so that nothing lifts them. With touches that a
// search had lost, and with displacements before each proof of rest, they were lifted by 0.4 % of their energy and rattled on.
TEST(drops, no_lift_of_cup_or_bowl_in_bowl) {
  const std::pair<int, int> falls[] = {{5, 4}, {6, 0}};
  for (const auto& [kind, turn] : falls) {
    const double half = 0.5 * (0.3 + 0.7 * turn);
    Solid bowl = make_drop_body(6, 0).solid, body = make_drop_body(kind, 0).solid;
    bowl.fixed = true;
    bowl.friction = body.friction = 0.4;
    bowl.restitution = body.restitution = 0.3;
    State at;
    at.centre = {0.01, 0, 0.15};
    at.rotation = {std::cos(half), 0.6 * std::sin(half), 0, 0.8 * std::sin(half)};
    Space space({bowl, body}, {State{}, at}, Ground{-1.0, 0.5, 0.5, 30e9, 0.2}, {0, 0, -9.81}, {});
    double kinetic_j = 0.0;
    while (space.get_time() < 1.0 - 1e-9) {
      space.step(1.0);
      kinetic_j = std::max(kinetic_j, calc_kinetic(body, space.state(1)));
    }
    EXPECT_LT(space.calc_books().lifted_j, kWanted.lifted * kinetic_j) << kDropBodies.at(kind);
  }
}

// A coin that rocks on its rim, 2 mm wide: its one touch goes from edge to edge. At rest it has touches on both edges.
TEST(drops, sleep_of_coin_on_rim) {
  const Solid coin = make_drop_body(1, 0).solid;
  const double tilt = 4e-3, half = 0.5 * (0.5 * std::numbers::pi + tilt);
  State at;
  at.rotation = {std::cos(half), std::sin(half), 0, 0};
  at.centre = {0, 0, 0.012 * std::cos(tilt) + 0.001 * std::sin(tilt) + 1e-6};
  Space space({coin}, {at}, Ground{0.0, 0.3, 0.5, 30e9, 0.2}, {0, 0, -9.81}, {});
  while (space.get_time() < 1.5 - 1e-9) space.step(1.5);
  EXPECT_TRUE(space.is_still(0));
  EXPECT_NEAR(space.state(0).centre[2], 0.012, 2e-6);
}

}  // namespace
}  // namespace carillon::rigid::tests
