// Directions::find() against its definition: a triangle that contains the direction, and no direction beyond it.
#include "runtime/acoustics/head/directions.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "runtime/base/error.hpp"
#include "tests/unit/runtime/acoustics/head/oracle.hpp"

namespace carillon::head {
namespace {

using testing::make_direction;

/// Grid of azimuths and elevations, each pole once: most quadrangles are planar.
std::vector<Vec3> make_grid(int step_deg) {
  std::vector<Vec3> unit{{0.0, 0.0, -1.0}, {0.0, 0.0, 1.0}};
  for (int elevation = -90 + step_deg; elevation < 90; elevation += step_deg)
    for (int azimuth = 0; azimuth < 360; azimuth += step_deg) unit.push_back(make_direction(azimuth, elevation));
  return unit;
}

std::vector<Vec3> make_random(std::size_t count, std::uint64_t seed) {
  std::mt19937_64 chance(seed);
  std::normal_distribution<double> normal;
  std::vector<Vec3> unit;
  while (unit.size() < count) {
    const Vec3 d = normalise(Vec3{normal(chance), normal(chance), normal(chance)});
    if (std::all_of(unit.begin(), unit.end(), [&](const Vec3& other) { return norm(other - d) > Directions::kNearestRad; }))
      unit.push_back(d);
  }
  return unit;
}

void check_set(const std::vector<Vec3>& unit) {
  const Directions directions(unit, "set");
  EXPECT_EQ(directions.count_triangles(), 2 * unit.size() - 4);  // Euler: every direction is a corner
  for (std::size_t i = 0; i < unit.size(); ++i) {
    const Surrounding at = directions.find(unit[i]);
    const std::size_t most = std::max_element(at.share.begin(), at.share.end()) - at.share.begin();
    EXPECT_EQ(at.direction[most], static_cast<int>(i));
    EXPECT_NEAR(at.share[most], 1.0, 1e-9);
  }
  for (const Vec3& d : make_random(300, 7)) {
    const Surrounding around = directions.find(d);
    Vec3 sum{};
    double total = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_GE(around.share[k], 0.0);
      total += around.share[k];
      sum = sum + around.share[k] * unit[around.direction[k]];
    }
    EXPECT_NEAR(total, 1.0, 1e-12);
    EXPECT_LT(norm(normalise(sum) - d), 1e-9);
    const auto corner = [&](std::size_t k) { return unit[around.direction[k]]; };
    const Vec3 normal = normalise(cross(corner(1) - corner(0), corner(2) - corner(0)));
    for (const Vec3& other : unit) EXPECT_LT(dot(normal, other - corner(0)), 1e-6);
  }
}

TEST(Directions, RegularGridsAreCovered) {
  check_set(make_grid(5));
  check_set(make_grid(15));
  check_set({{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}});
}

TEST(Directions, IrregularSetsAreCovered) {
  check_set(make_random(60, 1));
  check_set(make_random(2000, 2));
}

TEST(Directions, SharesAreContinuous) {
  const std::vector<Vec3> unit = make_random(400, 3);
  const Directions directions(unit, "set");
  const Vec3 axis = normalise(Vec3{0.3, -0.2, 1.0}), across = find_across(axis), third = cross(axis, across);
  std::vector<double> before, now;
  constexpr int kSteps = 20000;
  for (int i = 0; i <= kSteps; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / kSteps;
    const Surrounding around = directions.find(0.2 * axis + std::cos(angle) * across + std::sin(angle) * third);
    now.assign(unit.size(), 0.0);
    for (std::size_t k = 0; k < 3; ++k) now[around.direction[k]] += around.share[k];
    for (std::size_t k = 0; k < unit.size() && i > 0; ++k) ASSERT_LT(std::abs(now[k] - before[k]), 0.03) << i;
    before = now;
  }
}

TEST(Directions, InvalidDirectionsAreStraightAhead) {
  const Directions directions(make_grid(10), "set");
  const Surrounding ahead = directions.find({1.0, 0.0, 0.0});
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  for (const Vec3& d : {Vec3{0, 0, 0}, Vec3{nan, 0, 0}, Vec3{0, inf, 0}, Vec3{1e300, 1e300, 0}, Vec3{1e-300, 0, 0}}) {
    const Surrounding found = directions.find(d);
    EXPECT_EQ(found.direction, ahead.direction);
    EXPECT_EQ(found.share, ahead.share);
  }
  const Surrounding far = directions.find({30.0, 40.0, -5.0}), near = directions.find({0.3, 0.4, -0.05});
  for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(far.share[k], near.share[k], 1e-12);
}

TEST(Directions, RefusesSetsWithAGap) {
  std::vector<Vec3> half, ring;
  for (const Vec3& d : make_random(200, 5))
    if (d[0] > 0.0) half.push_back(d);
  for (int i = 0; i < 36; ++i) ring.push_back(make_direction(10.0 * i, 0.0));
  EXPECT_THROW(Directions(half, "set"), InputError);
  EXPECT_THROW(Directions(ring, "set"), InputError);
  EXPECT_THROW(Directions({}, "set"), InputError);
  EXPECT_THROW(Directions({{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, "set"), InputError);
}

}  // namespace
}  // namespace carillon::head
