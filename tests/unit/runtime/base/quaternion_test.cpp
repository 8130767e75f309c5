#include "runtime/base/quaternion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "runtime/base/vector.hpp"

namespace carillon {
namespace {

/// Rotation of x by q, by Rodrigues' formula.
Vec3 turn_by(const Quaternion& q, const Vec3& x) {
  const Vec3 v{q[1], q[2], q[3]};
  return x + 2.0 * cross(v, cross(v, x) + q[0] * x);
}

Quaternion turn_about(const Vec3& axis, double angle) {
  const Vec3 v = std::sin(0.5 * angle) * normalise(axis);
  return {std::cos(0.5 * angle), v[0], v[1], v[2]};
}

TEST(Quaternion, AProductRotatesBySecondThenFirst) {
  const Quaternion a = turn_about({1.0, 2.0, -0.5}, 0.7), b = turn_about({-0.3, 0.4, 1.0}, 2.1);
  for (const Vec3& x : {Vec3{1.0, 0.0, 0.0}, Vec3{0.2, -3.0, 0.5}}) {
    const Vec3 wanted = turn_by(a, turn_by(b, x)), found = turn_by(multiply(a, b), x);
    for (std::size_t k = 0; k < 3; ++k) EXPECT_NEAR(found[k], wanted[k], 1e-14);
  }
  // 90 degrees about z, then about x: x goes to y and on to z.
  const double quarter = 0.5 * std::numbers::pi;
  const Vec3 up = turn_by(multiply(turn_about({1, 0, 0}, quarter), turn_about({0, 0, 1}, quarter)), {1, 0, 0});
  EXPECT_NEAR(up[2], 1.0, 1e-15);
}

TEST(Quaternion, TheInverseRotatesBack) {
  const Quaternion q = turn_about({1.0, 2.0, -0.5}, 0.7), one = multiply(q, find_inverse(q));
  EXPECT_NEAR(one[0], 1.0, 1e-15);
  for (std::size_t k = 1; k < 4; ++k) EXPECT_NEAR(one[k], 0.0, 1e-16);
}

}  // namespace
}  // namespace carillon
