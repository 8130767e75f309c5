// Recorded surfaces of small balls, without carillon-simulate.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <numbers>
#include <string>
#include <vector>

#include "runtime/acoustics/recording/header.hpp"
#include "runtime/base/vector.hpp"
#include "tests/unit/runtime/acoustics/recording/seal_again.hpp"

namespace carillon::recording::testing {

/// Octahedron about a moving centre, whose facets move outwards with the same acceleration [m/s2] at a time [s].
struct Ball {
  double corner_m = 1e-3;
  std::function<Vec3(double)> centre_m = [](double) { return Vec3{}; };
  std::function<double(double)> acceleration_m_s2;
  double calc_area_m2() const { return 4.0 * std::sqrt(3.0) * corner_m * corner_m; }
};

struct BallOptions {
  double rate_hz = 48000.0;
  std::uint64_t frames = 4800;
  std::uint64_t key_frames = 48;
};

/// File of one ball, version 1.0, without the HDF5 structure around its arrays.
inline std::string make_ball_surface(const Ball& ball, const BallOptions& options = {}) {
  Header header;
  header.sample_rate_hz = options.rate_hz;
  header.frames = options.frames;
  header.key_frames = options.key_frames;
  header.vertices = 6;
  header.triangles = 8;
  header.bodies = 1;
  std::array<std::string, kArrays> arrays;
  const auto put = [&](Array array, const auto& value) {
    arrays[static_cast<std::size_t>(array)].append(reinterpret_cast<const char*>(&value), sizeof(value));
  };
  // Vertex 2 k + s: along axis k, to the positive side for s = 0.
  for (int octant = 0; octant < 8; ++octant) {
    std::array<std::int32_t, 3> corner{octant & 1, 2 + (octant >> 1 & 1), 4 + (octant >> 2 & 1)};
    if (std::popcount(static_cast<unsigned>(octant)) % 2 == 1) std::swap(corner[0], corner[1]);
    put(Array::kTriangle, corner);
    put(Array::kTriangleBody, std::int32_t{0});
    put(Array::kArea, ball.calc_area_m2() / 8.0);
  }
  for (int v = 0; v < 6; ++v) put(Array::kVertexBody, std::int32_t{0});
  put(Array::kRadius, std::sqrt(ball.calc_area_m2() / (4.0 * std::numbers::pi)));
  for (std::uint64_t key = 0; key < header.count_keys(); ++key) {
    put(Array::kCentre, ball.centre_m(static_cast<double>(key * header.key_frames) / options.rate_hz));
    put(Array::kStep, ball.corner_m / 32767.0);
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (const std::int16_t side : {32767, -32767}) {
        std::array<std::int16_t, 3> place{};
        place[axis] = side;
        put(Array::kPlace, place);
      }
  }
  for (std::uint64_t block = 0; block < header.count_blocks(); ++block) {
    std::array<double, kBlockFrames> values{};
    double most = 0.0;
    for (std::uint64_t i = 0; i < kBlockFrames && block * kBlockFrames + i < options.frames; ++i) {
      values[i] = ball.acceleration_m_s2(static_cast<double>(block * kBlockFrames + i) / options.rate_hz);
      most = std::max(most, std::abs(values[i]));
    }
    const auto scale = static_cast<float>(most / 32767.0);
    for (int t = 0; t < 8; ++t) {
      put(Array::kScale, scale);
      for (const double value : values)
        put(Array::kAcceleration, static_cast<std::int16_t>(scale > 0.0F ? std::lround(value / static_cast<double>(scale)) : 0));
    }
  }
  std::string body;
  for (std::size_t i = 0; i < kArrays; ++i) {
    header.offset[i] = kHeaderBytes + body.size();
    body += arrays[i];
  }
  header.length = kHeaderBytes + body.size();
  return seal_again(format_header(header) + std::string(kDigestBytes, '0') + body);
}

/// Pressure of a small ball: rho a A / (4 pi r), r / c later.
inline double calc_ball_pressure(const Ball& ball, const Vec3& at_m, double time_s) {
  const double r = norm(at_m - ball.centre_m(0.0));
  const double left_s = time_s - r / 343.0;
  return left_s < 0.0 ? 0.0 : 1.21 * ball.calc_area_m2() * ball.acceleration_m_s2(left_s) / (4.0 * std::numbers::pi * r);
}

}  // namespace carillon::recording::testing
