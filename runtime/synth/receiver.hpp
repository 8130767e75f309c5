// Propagation from a body to a microphone: spherical spreading, travel time, Doppler shift.
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

/// Emission of a body. Non-owning.
struct Source {
  const Trajectory* track = nullptr;
  const DelayLine* monopole = nullptr;       // Pa at 1 m, omnidirectional; Pa at the microphone if the receiver has a sphere
  std::array<const DelayLine*, 3> dipole{};  // Pa at 1 m along x, y, z of the world, cosine pattern; or nullptr
};

/// Propagation path of the sound that arrives at a time.
struct PathState {
  double delay_s = 0.0;
  double delay_slope = 0.0;    // change of the delay per arrival time
  double spreading_1_m = 0.0;  // 1 / r
  double spreading_slope = 0.0;
  Vec3 direction{};  // from the source to the microphone, unit
  Vec3 direction_slope{};
  double convection = 1.0;        // 1 / (1 - M), M: speed of the source towards the microphone over that of sound
  double convection_slope = 0.0;  // by the change of direction; the source's own acceleration is left out
};

/// Path of the sound arriving at `time_s` at `offset_m` from the listener: the source at its emission time t', the microphone at arrival,
/// t' + |x_source(t') - x_microphone(t)| / c = t. Speeds below that of sound. Pure; any thread.
PathState calc_path_state(const Trajectory& source, const Trajectory& listener, const Vec3& offset_m, double time_s) noexcept;

/// Cubic polynomial over a sub-block.
struct Cubic {
  double power[4]{};

  /// From two values with slopes per sub-block.
  static Cubic make(double a, double slope_a, double b, double slope_b) noexcept;
  bool is_constant() const noexcept { return power[1] == 0.0 && power[2] == 0.0 && power[3] == 0.0; }
  /// Values at samples from `first` on of the sub-block.
  void evaluate(int first, std::span<double> out) const noexcept;
};

/// One source at one microphone. Output sample n is the sound arriving at time (n - get_latency()) / rate. Invariant: delay, level and
/// direction are exact at the ends of each sub-block and cubic in between, for any block sizes.
class Receiver {
 public:
  static constexpr int kLatency = kTaps / 2;          // minimum latency [samples]
  static constexpr int kSubBlock = synth::kSubBlock;  // samples between exact paths

  /// `offset_m`: of the microphone from the listener, world axes. Effects used: kAirDelay and kDoppler; without the first there is no
  /// travel time, without the second the initial travel time is kept. `sphere_m`: 0, or the radius of the sphere about the source from
  /// which the sound is emitted with its spreading included, as by radiation::Transfers: delay (r - R) / c, no loss. `more_latency` >= 0:
  /// additional latency, to match receivers with filters.
  Receiver(const Vec3& offset_m, double sample_rate_hz, EffectSet effects = {Effect::kAirDelay, Effect::kDoppler}, Isa isa = Isa::kBest,
           double sphere_m = 0.0, int more_latency = 0);

  /// Sets the first sample, whose travel time is kept without kDoppler. Default: the first processed sample. [audio-thread]
  void begin(const Source& source, const Trajectory& listener, std::int64_t sample) noexcept;

  /// Adds the pressure [Pa] of samples `sample` to `sample + received_pa.size()`. The delay lines of the source hold these samples already.
  /// The bits do not depend on the block sizes. Returns the number of samples with a changing path length; resting sources and listeners
  /// are cheap. [audio-thread]: no heap, no lock, no throw.
  int process(const Source& source, const Trajectory& listener, std::int64_t sample, std::span<double> received_pa) noexcept;

  int get_latency() const noexcept { return latency_; }
  /// Vector from the source at emission to the microphone, for the end of the last processed sub-block; any length, zero if both coincide.
  /// [audio-thread]
  const Vec3& get_direction() const noexcept { return to_.direction; }

 private:
  PathState find_path_state(const Source& source, const Trajectory& listener, std::int64_t border, double& travel_s) noexcept;
  PathState calc_way(const Source& source, const Trajectory& listener, double time_s) const noexcept;
  void find_path_states(const Source& source, const Trajectory& listener, std::int64_t sub_block) noexcept;
  void set_path(const PathState& from, const PathState& to) noexcept;
  void process_piece(const Source& source, std::int64_t sample, std::span<double> received_pa) noexcept;
  void process_cut(const Source& source, std::int64_t sample, std::span<double> received_pa) noexcept;
  void process_still(const Source& source, std::int64_t sample, std::span<double> received_pa) noexcept;
  void process_moving(const Source& source, std::int64_t sample, std::span<double> received_pa) const noexcept;

  Vec3 offset_m_{};
  double rate_hz_ = 0.0;
  EffectSet effects_;
  const Kernels* kernels_ = nullptr;
  double sphere_m_ = 0.0;
  int latency_ = kLatency;
  std::int64_t sub_block_ = -1;  // sub-block from `from_` to `to_`
  PathState from_, to_;
  Cubic delay_, spreading_;  // between them [samples], [1/m]
  std::array<Cubic, 3> direction_;
  bool is_cut_ = false;         // the source jumps in the sub-block
  bool is_placed_ = false;      // first_delay_s_ is known
  double first_delay_s_ = 0.0;  // for receivers without kDoppler
  double travel_s_ = 0.0;       // of the sound at the end of the sub-block, regardless of effects
  double phase_ = -1.0;         // phase of taps_
  std::array<float, kTaps> taps_{};
};

}  // namespace carillon::synth
