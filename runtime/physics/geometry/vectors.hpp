// Vectors, frames and boxes of collision geometry.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "runtime/base/vector.hpp"

namespace carillon::geometry {

inline double norm2(const Vec3& a) { return dot(a, a); }

/// Pose of a body: x_world = R x + p, x in the mesh frame.
struct Frame {
  Mat3 rotation{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
  Vec3 position_m{};
  bool operator==(const Frame&) const = default;
};
inline Vec3 to_world(const Frame& f, const Vec3& x) { return f.rotation * x + f.position_m; }
inline Vec3 to_body(const Frame& f, const Vec3& x) { return turn_back(f.rotation, x - f.position_m); }

/// Axis-aligned box.
struct Box {
  Vec3 low{kFar, kFar, kFar}, high{-kFar, -kFar, -kFar};
  void add(const Vec3& x) {
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], x[k]);
      high[k] = std::max(high[k], x[k]);
    }
  }
  void add(const Box& other) {
    add(other.low);
    add(other.high);
  }
  bool overlaps(const Box& other) const {
    for (std::size_t k = 0; k < 3; ++k)
      if (other.low[k] > high[k] || low[k] > other.high[k]) return false;
    return true;
  }
  double calc_distance2(const Vec3& x) const {
    double sum = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double out = std::max({low[k] - x[k], x[k] - high[k], 0.0});
      sum += out * out;
    }
    return sum;
  }

  static constexpr double kFar = std::numeric_limits<double>::infinity();
};

}  // namespace carillon::geometry
