// Head-related transfer: an impulse response and a delay per direction and ear.
//
//   auto head = head::make_sphere(48000.0);            // sphere.hpp: a rigid sphere, no file
//   auto head = head::read_sofa("mine.sofa", 48000.0); // sofa.hpp: a measured head
//   head::EarFilter filter(head);                      // ear_filter.hpp: one per body and listener
//
// Frame of the head (as in SOFA files): x forward, y left, z up, origin between the ears. Directions point from the head to the source.
// Responses are the pressure at an ear over the pressure at the origin without the head.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <variant>
#include <vector>

#include "runtime/acoustics/head/directions.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::head {

/// Approximate onset of a response [samples]; earlier samples are ripple of the band limit.
inline constexpr int kOnset = 16;
inline constexpr int kMaxTaps = 8192;
inline constexpr double kMinRateHz = 8000.0, kMaxRateHz = 384000.0;

/// Response of one ear: weighted sum of three responses of the head, weights sum 1.
struct Blend {
  std::array<int, 3> response{};
  std::array<float, 3> weight{};
  bool operator==(const Blend&) const = default;
};

/// Rotationally symmetric head: responses depend on the angle between source and ear. Response i: angle i pi / steps.
struct ByAngle {
  std::array<Vec3, 2> ears{};  // unit vectors, left and right
  int steps = 0;
};

/// Measured directions: response 2 i is that of the left ear for direction i, 2 i + 1 that of the right ear.
struct ByDirection {
  Directions directions;
};

/// A head at one sample rate. Immutable; all responses have the same number of taps, a multiple of kTapUnit, and begin at kOnset, so they
/// can be blended; delays are not negative. Output lags by get_latency() behind arrival at the origin. Any thread, several at once.
class Head {
 public:
  struct Content {
    double sample_rate_hz = 0.0;
    int taps = 0;
    int origin_samples = 0;        // delay of the origin
    std::vector<float> responses;  // (count, taps), row-major
    std::vector<double> delays;    // (count) [samples]
    std::variant<ByAngle, ByDirection> lookup;
  };
  /// Use make_sphere() or read_sofa().
  explicit Head(Content content);

  double get_sample_rate_hz() const noexcept { return content_.sample_rate_hz; }
  int get_taps() const noexcept { return content_.taps; }
  std::size_t count_responses() const noexcept { return content_.delays.size(); }
  std::span<const float> get_response(int i) const noexcept {
    const std::size_t taps = content_.taps;
    return std::span(content_.responses).subspan(static_cast<std::size_t>(i) * taps, taps);
  }
  /// Delay [samples]; origin_samples for arrival at an ear at the same time as at the origin.
  double get_delay(int i) const noexcept { return content_.delays[i]; }
  double get_max_delay() const noexcept { return max_delay_; }
  /// Latency of an EarFilter [samples]: output n belongs to arrival at the origin at n - get_latency().
  int get_latency() const noexcept;

  /// Left and right response. `direction`: frame of the head, any length; zero or non-finite: straight ahead. [audio-thread]
  std::array<Blend, 2> find(const Vec3& direction) const noexcept;

 private:
  Content content_;
  double max_delay_ = 0.0;
};

}  // namespace carillon::head
