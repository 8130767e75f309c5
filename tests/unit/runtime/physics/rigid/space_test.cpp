// Groups that nothing pulls: momentum and angular momentum.
#include "runtime/physics/rigid/space.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "tests/unit/runtime/physics/rigid/bodies.hpp"
#include "tests/unit/runtime/physics/rigid/momenta.hpp"

namespace carillon::rigid {
namespace {

TEST(space, momenta_and_energy_of_free_crowd) {
  // 27 boxes fly to one place and strike each other many times within a step.
  std::vector<Solid> solids;
  std::vector<State> states;
  double size = 0.0;
  const Vec3 sides{0.06, 0.05, 0.04};
  for (int i = 0; i < 27; ++i) {
    solids.push_back(make_solid(geometry::tests::make_box(sides, 1), 0.1, sides));
    State s;
    s.centre = {0.075 * (i % 3 - 1), 0.075 * (i / 3 % 3 - 1), 0.075 * (i / 9 - 1)};
    s.velocity = -10.0 * s.centre + Vec3{0.1, 0.2, 0.3};
    s.rotation = normalise({1.0, 0.03 * (i % 5), 0.02 * (i % 7), 0.05 * (i % 3)});
    states.push_back(s);
    size += solids.back().mass_kg * norm(s.velocity);
  }
  Space space(std::move(solids), std::move(states), std::nullopt, {}, {});
  const Momenta before = add_up(space);
  while (space.get_time() < 0.5) space.step(0.5);
  const Momenta after = add_up(space);
  EXPECT_GT(space.get_costs().impacts, 50);
  EXPECT_LT(norm(after.linear - before.linear), 1e-10 * size);
  EXPECT_LT(norm(after.angular - before.angular), 1e-10 * size * 0.12);
  EXPECT_LT(after.kinetic_j, before.kinetic_j);
  const Books books = space.calc_books();
  EXPECT_NEAR(books.calc_total(), before.kinetic_j, 1e-2 * before.kinetic_j);
}

// Slow boxes that are removed at the end of a window, some of them in the step in which the ground stops them.
TEST(space, energy_of_bodies_removed_while_landing) {
  int stopped = 0;
  for (int n = 0; n < 40; ++n) {
    const Vec3 sides{0.06, 0.05, 0.04};
    State above;
    above.centre = {0, 0, 0.5 * sides[2] + 1e-7 * (3 + n)};
    above.velocity = {0, 0, -8e-4};
    Space space({make_box(0.1, sides)}, {above}, Ground{0.0, 0.2, 0.4, 30e9, 0.2}, {}, {});
    const double before_j = space.calc_books().calc_total();
    for (int windows = 0; windows < 2;) {
      space.step(1.0);
      if (!space.is_at_window()) continue;
      ++windows;
      if (!(space.calc_books().springs_j > 0.0)) continue;
      ++stopped;
      space.remove(0);
      break;
    }
    EXPECT_NEAR(space.calc_books().calc_total(), before_j, 1e-12 * before_j) << n;
  }
  EXPECT_GT(stopped, 0);
}

TEST(space, momenta_of_free_group) {
  // Boxes and balls that fly into each other: they strike, slide along and roll off each other.
  std::vector<Solid> solids;
  std::vector<State> states;
  double size = 0.0;
  for (int i = 0; i < 6; ++i) {
    const Vec3 sides{0.06, 0.05, 0.04};
    solids.push_back(i % 2 ? make_solid(geometry::tests::make_box(sides, 1), 0.1 + 0.05 * i, sides)
                           : make_solid(geometry::tests::make_ball(0.03, 8), 0.2, {0.0465, 0.0465, 0.0465}));
    const double a = i * std::acos(-1.0) / 3;
    State s;
    s.centre = {0.12 * std::cos(a), 0.12 * std::sin(a), 0.01 * i};
    s.velocity = {-0.8 * std::cos(a) - 0.2 * std::sin(a), -0.8 * std::sin(a) + 0.2 * std::cos(a), 0.05 * i};
    s.rotation = normalise({0.9, 0.1 * i, 0.2, -0.1});
    const Mat3 rotation = make_rotation(s.rotation);
    s.momentum = rotation * (solids.back().inertia_kg_m2 * (transpose(rotation) * Vec3{3.0 * i, -2.0, 5.0 - i}));
    states.push_back(s);
    size += solids.back().mass_kg * norm(s.velocity);
  }
  Space space(std::move(solids), std::move(states), std::nullopt, {}, {});
  const Momenta before = add_up(space);
  while (space.get_time() < 1.0) space.step(1.0);
  const Momenta after = add_up(space);
  EXPECT_GT(space.get_costs().impacts, 4);
  EXPECT_LT(norm(after.linear - before.linear), 1e-10 * size);
  EXPECT_LT(norm(after.angular - before.angular), 1e-10 * size * 0.12);
}

TEST(space, no_impact_of_rotating_body_leaving_ground) {
  // The lowest edge parts from its last touch by less than an impact is looked for from, and its body turns so fast that it does not come
  // back: a parabola through its velocities would.
  const Vec3 sides{0.06, 0.05, 0.04};
  const double gap = 1.2e-7, up = 1e-4, spin = 30.0, tilt = 0.3;
  const double across = 0.5 * sides[0], along = 0.5 * sides[2];
  State start;
  start.rotation = {std::cos(0.5 * tilt), 0, std::sin(0.5 * tilt), 0};
  const Mat3 rotation = make_rotation(start.rotation);
  Solid solid = make_solid(geometry::tests::make_box(sides, 1), 0.1, sides);
  const Vec3 turning{0, spin, 0}, arm = rotation * Vec3{across, 0, -along};
  start.centre = {0, 0, gap - arm[2]};
  start.velocity = {0, 0, up - cross(turning, arm)[2]};
  start.momentum = rotation * (solid.inertia_kg_m2 * (transpose(rotation) * turning));
  Space space({solid}, {start}, Ground{.restitution = 0.2, .young_modulus_pa = 10e9, .poisson_ratio = 0.3}, {0, 0, -9.81}, {});
  space.step(2e-3);
  EXPECT_EQ(space.get_costs().impacts, 0);
  EXPECT_LE(space.get_costs().solves, 2) << "after " << space.get_time() << " s";
}

TEST(space, steady_precession_of_disc) {
  // A disc of thickness 2 e that leans by a about a fixed centre: W^2 sin a (A cos a - C e/r sin a) = m g (r cos a - e sin a), derived in
  // Rolling.SteadyPrecessionOfCoin; for e = 0 that of H. K. Moffatt, Nature 404 (2000), eq. 2. It comes no lower.
  struct Case {
    double radius, e, degrees, end_s;
  };
  for (const Case& d : {Case{0.075, 0.001, 14, 1.0}, Case{0.075, 0.001, 30, 1.0}, Case{0.012, 0.001, 8, 0.3}, Case{0.012, 0.001, 14, 0.3},
                        Case{0.012, 0.001, 30, 0.3}}) {
    const double mass = 7850.0 * 2.0 * M_PI * d.radius * d.radius * d.e, gravity = 9.81, a = d.degrees * M_PI / 180, s = std::sin(a),
                 c = std::cos(a);
    const double across = mass * (0.25 * d.radius * d.radius + d.e * d.e / 3.0), along = 0.5 * mass * d.radius * d.radius;
    const double rate = std::sqrt(mass * gravity * (d.radius * c - d.e * s) / (s * (across * c - along * d.e / d.radius * s)));
    Solid disc = make_solid(geometry::tests::make_cylinder(d.radius, 2.0 * d.e, 96), mass, {});
    for (std::size_t k = 0; k < 3; ++k) {
      disc.inertia_kg_m2[k][k] = k == 2 ? along : across;
      disc.inverse_inertia[k][k] = 1.0 / disc.inertia_kg_m2[k][k];
    }
    disc.restitution = 0.0;
    disc.friction = 0.8;
    disc.rolling_resistance = 0.0;
    disc.young_modulus_pa = 200e9;
    State start;
    start.rotation = {std::cos(0.5 * a), std::sin(0.5 * a), 0, 0};
    start.centre = {0, 0, d.radius * s + d.e * c};
    const Mat3 rotation = make_rotation(start.rotation);
    const Vec3 spin = -rate * s * (Vec3{0, -c, -s} - (d.e / d.radius) * Vec3{0, -s, c});
    start.momentum = rotation * (disc.inertia_kg_m2 * (transpose(rotation) * spin));
    Space space({disc}, {start}, Ground{0.0, 0.0, 0.8, 200e9, 0.3, 0.0}, {0, 0, -gravity}, {});
    double turned = 0.0, before = -0.5 * M_PI, lowest_m = start.centre[2];
    while (space.get_time() < d.end_s - 1e-9) {
      space.step(d.end_s);
      const Mat3 now = make_rotation(space.state(0).rotation);
      const double angle = std::atan2(now[1][2], now[0][2]);
      turned += std::remainder(angle - before, 2 * M_PI);
      before = angle;
      lowest_m = std::min(lowest_m, space.state(0).centre[2]);
    }
    const double kinetic_j = calc_kinetic(disc, start);
    EXPECT_NEAR(std::abs(turned) / (rate * d.end_s), 1.0, 0.01) << d.radius << " m, " << d.degrees << " degrees";
    EXPECT_GT(lowest_m, start.centre[2] - 2e-3) << d.radius << " m, " << d.degrees << " degrees";
    EXPECT_NEAR(space.calc_books().calc_total(), mass * gravity * start.centre[2] + kinetic_j, 1e-3 * kinetic_j);
  }
}

}  // namespace
}  // namespace carillon::rigid
