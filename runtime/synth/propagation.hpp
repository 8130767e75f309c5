// From a sounding body to an ear: spherical spreading, travel time, and the Doppler shift that follows from it.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::synth {

using Vec3 = std::array<double, 3>;

using bank::kSoundSpeedMs;
inline constexpr double kNearestM = 0.05;  // a source never counts as nearer than this (1/r has no bound)

/// Where a source is over time: cubic between the given points, with slopes from their neighbours, so that its speed is continuous.
/// Before the first and after the last point it rests there.
class Path {
 public:
  struct Point {
    double time_s = 0.0;
    Vec3 position_m{};
  };
  /// `points` in order of time, at least one; points at the same time keep the last. Throws InputError otherwise.
  explicit Path(std::vector<Point> points);

  /// [audio-thread] `hint` remembers the segment of the last call; start it at 0.
  Vec3 find_position(double time_s, std::size_t& hint) const noexcept;
  bool is_still() const { return points_.size() == 1; }

 private:
  std::vector<Point> points_;
  std::vector<Vec3> slope_m_s_;
};

/// One source heard at one place. Sample n of the output is what arrives at time (n - kLatency) / rate: p(t') / r(t') with
/// t' + r(t') / c = t. The pressure is read between its samples by a windowed sinc of kTaps taps.
class Propagation {
 public:
  static constexpr int kTaps = 32;
  static constexpr int kLatency = kTaps / 2;  // samples by which the output lags behind

  /// Takes memory for travel times up to `longest_m` metres. `path` must outlive this. Throws InputError for distances that are not finite.
  Propagation(const Path& path, const Vec3& receiver_m, double sample_rate_hz, double longest_m);

  /// Adds the pressure at the receiver [Pa]. `pressure_pa` is the source's pressure at 1 m; both spans have the same length.
  /// [audio-thread]: no heap, no lock, no throw.
  void process(std::span<const double> pressure_pa, std::span<double> received_pa) noexcept;

 private:
  double calc_distance_m(double time_s) noexcept;
  double read_history(double sample) const noexcept;

  const Path* path_ = nullptr;
  Vec3 receiver_m_{};
  double rate_hz_ = 0.0;
  std::size_t hint_ = 0;
  double distance_m_ = 0.0;      // of the last sample: where the search for the next begins
  std::int64_t position_ = 0;    // samples taken in
  std::vector<double> history_;  // the last 2^k samples of the source
};

}  // namespace carillon::synth
