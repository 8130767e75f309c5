// Acceleration noise: the click of a body that is suddenly accelerated as a rigid body.
#pragma once

#include <array>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/events/events.hpp"
#include "runtime/synth/pulse.hpp"
#include "runtime/synth/trajectory.hpp"

namespace carillon::synth {

/// Dipole radiation of a rigid sphere with the body's outer volume and mass, driven by the same pulses as the modes. Allocates in the
/// constructor only. One thread at a time.
class AccelerationNoise {
 public:
  /// Throws InputError unless radius [m], mass [kg] and rate are positive.
  AccelerationNoise(double radius_m, double mass_kg, double sample_rate_hz, int max_strikes = 256, int max_forces = 256);

  /// Queues a pulse; `to_world` rotates the impulse from the body frame. Sound leaves the surface nearest to the listener, radius / c
  /// earlier than from the centre, where receivers place it: the pulse acts earlier by as much. False if refused: not finite, or queue
  /// full. [audio-thread]: no heap, no lock, no throw.
  bool strike(const events::Impulse& impulse, const events::Quaternion& to_world) noexcept;

  /// Force known step by step.
  bool push(const events::Force& force, const events::Quaternion& to_world) noexcept;

  /// Writes the next samples of the dipole along x, y and z of the world [Pa at 1 m], three spans of one size. The bits do not depend on
  /// the block sizes. At rest it only writes zeros. [audio-thread]: no heap, no lock, no throw.
  void process(const std::array<std::span<float>, 3>& dipole_pa) noexcept;

  bool is_awake() const { return awake_; }
  /// True while process() would only give zeros.
  bool is_idle() const { return !awake_ && pulses_.empty() && forces_.empty(); }
  /// process() of an idle object without output. [audio-thread]
  void skip(std::int64_t samples) noexcept { position_ += samples; }
  /// Clears the state and all pulses. [audio-thread]
  void reset() noexcept;
  /// Takes over time, strikes and state of another object; the sound continues without a step and decays as this sphere's. [audio-thread]
  void take_over(const AccelerationNoise& other) noexcept;
  std::int64_t get_refused() const { return refused_; }

 private:
  using Complex = std::complex<double>;
  struct Pulse {
    double begin = 0.0, length = 0.0;  // samples in which the force is not zero
    events::PulseShape shape = events::PulseShape::kHertz;
    std::array<double, 3> impulse_n_s{};
  };

  struct Steps {
    double begin = 0.0, step = 0.0;  // in samples
    int count = 0;
    std::array<std::array<float, 3>, events::kMaxForceSteps> impulse_n_s{};
  };

  Complex calc_answer(const Pulse& pulse) const noexcept;
  void add_answer(const Steps& steps) noexcept;

  double rate_hz_ = 0.0;
  double radius_s_ = 0.0;                // radius / c
  double gain_ = 0.0;                    // Pa at 1 m for unit velocity of the oscillator
  int substeps_ = 1;                     // substeps per sample, so that the response within one is smooth
  Complex turn_;                         // e^{(-1 + i) h c / a} of one sample
  std::array<Complex, kMoments> force_;  // Chebyshev coefficients of the response within a substep
  Complex sub_turn_;
  std::array<Complex, 3> state_{};  // (q' + q c / a) + i q c / a along x, y, z
  std::vector<Pulse> pulses_;       // capacity max_strikes, never grown
  std::vector<Steps> forces_;       // capacity max_forces, never grown
  std::int64_t position_ = 0;
  std::int64_t refused_ = 0;
  bool awake_ = false;
};

}  // namespace carillon::synth
