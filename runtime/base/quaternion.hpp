// Rotations as unit quaternions (w, x, y, z).
#pragma once

#include <array>

namespace carillon {

using Quaternion = std::array<double, 4>;

/// Rotation b followed by rotation a.
constexpr Quaternion multiply(const Quaternion& a, const Quaternion& b) noexcept {
  return {a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3], a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
          a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1], a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]};
}

/// Inverse rotation.
constexpr Quaternion find_inverse(const Quaternion& q) noexcept { return {q[0], -q[1], -q[2], -q[3]}; }

}  // namespace carillon
