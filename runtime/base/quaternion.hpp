// Rotations as unit quaternions (w, x, y, z).
#pragma once

#include <array>
#include <cmath>

#include "runtime/base/vector.hpp"

namespace carillon {

using Quaternion = std::array<double, 4>;

/// Rotation b followed by rotation a.
constexpr Quaternion multiply(const Quaternion& a, const Quaternion& b) noexcept {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

/// Unit quaternion of the same rotation; q must not be zero.
inline Quaternion normalise(const Quaternion& q) {
  const double s = 1.0 / std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  return {s * q[0], s * q[1], s * q[2], s * q[3]};
}

/// Matrix of a unit quaternion.
inline Mat3 make_rotation(const Quaternion& q) {
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  return {Vec3{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
          Vec3{2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
          Vec3{2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
}

/// From a rotation vector [rad], exact.
inline Quaternion make_turn(const Vec3& turn) {
  const double angle = norm(turn);
  const double s = angle > 1e-6 ? std::sin(0.5 * angle) / angle : 0.5 - angle * angle / 48.0;
  return {std::cos(0.5 * angle), s * turn[0], s * turn[1], s * turn[2]};
}

/// Inverse rotation.
constexpr Quaternion find_inverse(const Quaternion& q) noexcept { return {q[0], -q[1], -q[2], -q[3]}; }

}  // namespace carillon
