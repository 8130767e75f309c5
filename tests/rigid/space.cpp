// Groups that nothing pulls: momentum and angular momentum.
#include "runtime/rigid/space.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "tests/shape/solids.hpp"

namespace carillon::rigid {
namespace {

using impact::cross;

/// A solid of a given mass with the inertia of a box of such sides.
Solid make_solid(const shape::tests::Solid& from, double mass_kg, const Vec3& sides) {
  Solid s;
  s.shape = from.make();
  s.mass_kg = mass_kg;
  s.restitution = 0.2;
  s.friction = 0.4;
  s.young_modulus_pa = 10e9;
  s.poisson_ratio = 0.3;
  for (std::size_t k = 0; k < 3; ++k) {
    const double u = sides[(k + 1) % 3], v = sides[(k + 2) % 3], inertia = mass_kg * (u * u + v * v) / 12.0;
    s.inertia_kg_m2[k][k] = inertia;
    s.inverse_inertia[k][k] = 1.0 / inertia;
  }
  for (const Vec3& x : from.vertices) s.radius_m = std::max(s.radius_m, norm(x));
  return s;
}

TEST(space, free_group_keeps_momentum_and_angular_momentum) {
  // Boxes and balls that fly into each other: they strike, slide along and roll off each other.
  std::vector<Solid> solids;
  std::vector<State> states;
  double size = 0.0;
  for (int i = 0; i < 6; ++i) {
    const Vec3 sides{0.06, 0.05, 0.04};
    solids.push_back(i % 2 ? make_solid(shape::tests::make_box(sides, 1), 0.1 + 0.05 * i, sides)
                           : make_solid(shape::tests::make_ball(0.03, 8), 0.2, {0.0465, 0.0465, 0.0465}));
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
  const auto calc = [&] {
    Vec3 momentum{}, angular{};
    for (int i = 0; i < 6; ++i) {
      const State& s = space.state(i);
      const Vec3 p = space.solid(i).mass_kg * s.velocity;
      momentum = momentum + p;
      angular = angular + cross(s.centre, p) + s.momentum;
    }
    return std::pair(momentum, angular);
  };
  const auto [momentum, angular] = calc();
  while (space.get_time() < 1.0) space.step(1.0);
  const auto [momentum_after, angular_after] = calc();
  EXPECT_GT(space.get_costs().impacts, 4);
  EXPECT_LT(norm(momentum_after - momentum), 1e-10 * size);
  EXPECT_LT(norm(angular_after - angular), 1e-10 * size * 0.12);
}

}  // namespace
}  // namespace carillon::rigid
