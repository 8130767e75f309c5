// What a head does to sound on its way to two ears: an impulse response and a delay for every direction and ear.
//
//   auto head = head::make_sphere(48000.0);            // sphere.hpp: a rigid sphere, no file
//   auto head = head::read_sofa("mine.sofa", 48000.0); // sofa.hpp: a measured head
//   head::EarFilter filter(head);                      // ear_filter.hpp: one for each body and listener
//
// Frame of the head: x forward, y left, z up; its origin is between the ears. A direction points from the head to the source. It is the
// frame of SOFA files. Responses are pressures at an ear over the pressure that would be at the origin without the head.
#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <variant>
#include <vector>

#include "runtime/base/vector.hpp"
#include "runtime/acoustics/head/directions.hpp"

namespace carillon::head {

/// The sample of a response at which its sound begins, about; what comes before is ripple of the band limit.
inline constexpr int kOnset = 16;
inline constexpr int kMaxTaps = 8192;
inline constexpr double kMinRateHz = 8000.0, kMaxRateHz = 384000.0;

/// What makes the response of one ear: the sum of three of a head's responses by their weights, which sum to 1.
struct Blend {
  std::array<int, 3> response{};
  std::array<float, 3> weight{};
  bool operator==(const Blend&) const = default;
};

/// A head that is the same from all sides: responses depend on the angle between source and ear alone. Response i is that of the angle
/// i pi / steps.
struct ByAngle {
  std::array<Vec3, 2> ears{};  // unit vectors, left and right
  int steps = 0;
};

/// Directions of a measured head: response 2 i is that of the left ear for direction i, 2 i + 1 that of the right one.
struct ByDirection {
  Directions directions;
};

/// One head at one sample rate. Invariant: it does not change; all responses have as many taps, a multiple of kTapUnit, and begin
/// at kOnset, so that they may be blended; delays are not negative. All that is heard lags by get_latency() behind what arrives at the
/// origin. Any thread, several at once.
class Head {
 public:
  struct Content {
    double sample_rate_hz = 0.0;
    int taps = 0;
    int origin_samples = 0;        // the delay of what arrives at the origin
    std::vector<float> responses;  // (count, taps), row-major
    std::vector<double> delays;    // (count) [samples]
    std::variant<ByAngle, ByDirection> lookup;
  };
  /// make_sphere() and read_sofa() make it.
  explicit Head(Content content);

  double get_sample_rate_hz() const noexcept { return content_.sample_rate_hz; }
  int get_taps() const noexcept { return content_.taps; }
  std::size_t count_responses() const noexcept { return content_.delays.size(); }
  std::span<const float> get_response(int i) const noexcept {
    const std::size_t taps = content_.taps;
    return std::span(content_.responses).subspan(static_cast<std::size_t>(i) * taps, taps);
  }
  /// [samples], with origin_samples for what arrives at an ear when it would arrive at the origin.
  double get_delay(int i) const noexcept { return content_.delays[i]; }
  double get_max_delay() const noexcept { return max_delay_; }
  /// Samples by which an EarFilter's output lags: sample n is what would arrive at the origin at sample n - get_latency(), earlier or later
  /// by what the head makes of it.
  int get_latency() const noexcept;

  /// Left and right. `direction`: frame of the head, any length; of no length or not finite: straight ahead. [audio-thread]
  std::array<Blend, 2> find(const Vec3& direction) const noexcept;

 private:
  Content content_;
  double max_delay_ = 0.0;
};

}  // namespace carillon::head
