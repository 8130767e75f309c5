// Ambisonic encoding: sound from a direction as spherical harmonics at one point.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <span>

#include "runtime/base/vector.hpp"

namespace carillon::synth {

inline constexpr int kMaxAmbisonicOrder = 3;
constexpr std::size_t count_ambisonic_channels(int order) { return static_cast<std::size_t>((order + 1) * (order + 1)); }
inline constexpr std::size_t kMaxAmbisonicChannels = count_ambisonic_channels(kMaxAmbisonicOrder);

/// Real spherical harmonics of a direction, by number l^2 + l + m with the normalisation SN3D (AmbiX: Nachbar, Zotter, Deleflie and
/// Sontacchi 2011). `direction`: to the source; x forward, y left, z up; any length, zero counts as straight ahead.
inline std::array<double, kMaxAmbisonicChannels> calc_ambisonic_gains(const Vec3& direction) noexcept {
  const double length = norm(direction);
  const Vec3 unit = length > 0.0 ? (1.0 / length) * direction : Vec3{1.0, 0.0, 0.0};
  const double x = unit[0], y = unit[1], z = unit[2], xx = x * x, yy = y * y, zz = z * z;
  const double r3 = std::sqrt(3.0), r15 = std::sqrt(15.0), r58 = std::sqrt(0.625), r38 = std::sqrt(0.375);
  return {1.0,
          y,
          z,
          x,
          r3 * x * y,
          r3 * y * z,
          0.5 * (3.0 * zz - 1.0),
          r3 * x * z,
          0.5 * r3 * (xx - yy),
          r58 * y * (3.0 * xx - yy),
          r15 * x * y * z,
          r38 * y * (5.0 * zz - 1.0),
          0.5 * z * (5.0 * zz - 3.0),
          r38 * x * (5.0 * zz - 1.0),
          0.5 * r15 * z * (xx - yy),
          r58 * x * (xx - 3.0 * yy)};
}

/// Encoder of one body by one path. Its gains go linearly from one direction to the next. [audio-thread]
class AmbisonicEncoder {
 public:
  explicit AmbisonicEncoder(int order) : channels_(count_ambisonic_channels(order)) {}

  /// Adds the sound at the point without spherical harmonics [Pa] to mix[channel][first...]. `direction`: that at the end of `input`. After
  /// silence it holds from the beginning.
  template <class Mix>
  void process(const Vec3& direction, std::span<const double> input, Mix& mix, std::size_t first) noexcept {
    bool is_silent = true;
    for (const double p : input) is_silent = is_silent && p == 0.0;
    if (is_silent) {
      is_placed_ = false;
      return;
    }
    const std::array<double, kMaxAmbisonicChannels> now = calc_ambisonic_gains(direction);
    if (!is_placed_) before_ = now;
    is_placed_ = true;
    for (std::size_t c = 0; c < channels_; ++c) {
      const double slope = (now[c] - before_[c]) / static_cast<double>(input.size());
      for (std::size_t n = 0; n < input.size(); ++n) mix[c][first + n] += input[n] * (before_[c] + slope * static_cast<double>(n + 1));
    }
    before_ = now;
  }

 private:
  std::size_t channels_;
  std::array<double, kMaxAmbisonicChannels> before_{};
  bool is_placed_ = false;
};

}  // namespace carillon::synth
