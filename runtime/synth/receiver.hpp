// From a sounding body to a microphone: spherical spreading, travel time, and the Doppler shift that follows from it.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "runtime/bank/bank.hpp"
#include "runtime/synth/delay_line.hpp"
#include "runtime/synth/effects.hpp"
#include "runtime/synth/kernels.hpp"
#include "runtime/synth/trajectory.hpp"

namespace carillon::synth {

using bank::kSoundSpeedMs;
inline constexpr double kNearestM = 0.05;  // a source never counts as nearer than this (1/r has no bound)

/// What a body sends out, and from where. None of it is owned.
struct Source {
  const Trajectory* track = nullptr;
  const DelayLine* monopole = nullptr;       // Pa at 1 m, all round; Pa at the microphone where the receiver has a sphere
  std::array<const DelayLine*, 3> dipole{};  // Pa at 1 m along x, y, z of the world, cosine elsewhere; or nullptr
};

/// PathState of a sound that arrives at some time.
struct PathState {
  double delay_s = 0.0;
  double delay_slope = 0.0;    // change of the delay per time of arrival
  double spreading_1_m = 0.0;  // 1 / r
  double spreading_slope = 0.0;
  Vec3 direction{};  // from the source to the microphone, unit
  Vec3 direction_slope{};
  double convection = 1.0;        // 1 / (1 - M), M: speed of the source towards the microphone over that of sound
  double convection_slope = 0.0;  // of what the direction changes; the source's own acceleration is left out
};

/// The path of what arrives at `time_s` at the place `offset_m` from the listener: the source is where it was when it sent it, the
/// microphone where it is now, t' + |x_source(t') - x_microphone(t)| / c = t. Speeds below that of sound. Pure; any thread.
PathState calc_path_state(const Trajectory& source, const Trajectory& listener, const Vec3& offset_m, double time_s) noexcept;

/// A number over a sub-block: cubic in the sample.
struct Cubic {
  double power[4]{};

  /// Between two values with slopes per sub-block.
  static Cubic make(double a, double slope_a, double b, double slope_b) noexcept;
  bool is_constant() const noexcept { return power[1] == 0.0 && power[2] == 0.0 && power[3] == 0.0; }
  /// At samples from `first` on of the sub-block.
  void evaluate(int first, std::span<double> out) const noexcept;
};

/// One source heard by one microphone. Sample n of the output is what arrives at time (n - get_latency()) / rate. Invariant: delay, level
/// and direction are exact at the ends of each sub-block and cubic in between, however the calls divide the samples.
class Receiver {
 public:
  static constexpr int kLatency = kTaps / 2;          // samples by which the output lags behind at least
  static constexpr int kSubBlock = synth::kSubBlock;  // samples between two ways; cubic in time between

  /// `offset_m`: of the microphone from the listener, in the axes of the world. Of the effects kAirDelay and kDoppler are looked at:
  /// without the first sound takes no time, without the second it takes as long as at the beginning, wherever its source goes.
  /// `sphere_m`: 0, or the radius of the sphere about the source from which the sound sets out with its spreading already in it, as
  /// radiation::Transfers gives it: it takes (r - R) / c and loses nothing on its way. `more_latency` >= 0: samples by which the output
  /// lags in addition, so that it comes with that of receivers whose sound goes through something else.
  Receiver(const Vec3& offset_m, double sample_rate_hz, EffectSet effects = {Effect::kAirDelay, Effect::kDoppler}, Isa isa = Isa::kBest,
           double sphere_m = 0.0, int more_latency = 0);

  /// Says where the first sample is: without kDoppler its sound takes as long for ever. Without a call it is the first that is processed.
  /// [audio-thread]
  void begin(const Source& source, const Trajectory& listener, std::int64_t sample) noexcept;

  /// Adds the pressure [Pa] of samples `sample` to `sample + received_pa.size()`. The source's delay lines hold these samples already.
  /// Calls of any size give the same bits. Returns how many samples came by a way whose length changed; those of a source and a listener
  /// that stand still are cheap. [audio-thread]: no heap, no lock, no throw.
  int process(const Source& source, const Trajectory& listener, std::int64_t sample, std::span<double> received_pa) noexcept;

  int get_latency() const noexcept { return latency_; }
  /// From the source, where it was when it sent what arrives at the end of the sub-block that was processed last, to the microphone; of any
  /// length, and none where both are at one place. [audio-thread]
  const Vec3& get_direction() const noexcept { return to_.direction; }

 private:
  PathState find_path_state(const Source& source, const Trajectory& listener, std::int64_t border, double& travel_s) noexcept;
  PathState calc_way(const Source& source, const Trajectory& listener, double time_s) const noexcept;
  void find_path_states(const Source& source, const Trajectory& listener, std::int64_t sub_block) noexcept;
  void process_still(const Source& source, std::int64_t sample, std::span<double> received_pa) noexcept;
  void process_moving(const Source& source, std::int64_t sample, std::span<double> received_pa) const noexcept;

  Vec3 offset_m_{};
  double rate_hz_ = 0.0;
  EffectSet effects_;
  const Kernels* kernels_ = nullptr;
  double sphere_m_ = 0.0;
  int latency_ = kLatency;
  std::int64_t sub_block_ = -1;  // of which `from_` is the beginning and `to_` the end
  PathState from_, to_;
  Cubic delay_, spreading_;  // between them [samples], [1/m]
  std::array<Cubic, 3> direction_;
  bool is_placed_ = false;      // first_delay_s_ is known
  double first_delay_s_ = 0.0;  // for receivers without kDoppler
  double travel_s_ = 0.0;       // of what arrives at the end of quantum_, whatever this ear's effects make of it
  double phase_ = -1.0;         // of taps_
  std::array<float, kTaps> taps_{};
};

}  // namespace carillon::synth
