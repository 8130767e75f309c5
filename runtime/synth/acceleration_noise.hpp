// Acceleration noise: the click of a body that is suddenly set in motion as a whole, whatever its modes do.
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

/// A rigid sphere of the body's outer volume and mass, pushed by the same pulses as the modes. It radiates as a dipole: what a listener
/// hears is the pressure along the direction to it. Memory is taken in the constructor only. One thread at a time.
class AccelerationNoise {
 public:
  /// Throws InputError when radius [m], mass [kg] or rate is not a positive number.
  AccelerationNoise(double radius_m, double mass_kg, double sample_rate_hz, int max_strikes = 256, int max_forces = 256);

  /// Registers a pulse; the impulse is turned from the body's frame into the world's by `to_world`. Sound comes from the surface that is
  /// nearest to the listener, radius / c earlier than from the centre, at which receivers place it: the pulse begins to act by so much
  /// before its time. False when it was refused: not finite, or no room. [audio-thread]: no heap, no lock, no throw.
  bool strike(const events::Impulse& impulse, const events::Quaternion& to_world) noexcept;

  /// The same for a force that is known step by step.
  bool push(const events::Force& force, const events::Quaternion& to_world) noexcept;

  /// How long before its beginning a strike has to be known.
  double get_lead_s() const { return radius_s_; }

  /// Writes the next samples of the dipole along x, y and z of the world [Pa at 1 m], the three of one size. Calls of any size give the
  /// same bits. A body at rest costs nothing but the zeros. [audio-thread]: no heap, no lock, no throw.
  void process(const std::array<std::span<float>, 3>& dipole_pa) noexcept;

  bool is_awake() const { return awake_; }
  /// process() would only give zeros.
  bool is_idle() const { return !awake_ && pulses_.empty() && forces_.empty(); }
  /// As process() of so many samples of a click that is idle, without output. [audio-thread]
  void skip(std::int64_t samples) noexcept { position_ += samples; }
  /// Silence; no pulse is left. [audio-thread]
  void reset() noexcept;
  /// Takes the place of another click, with its time and its strikes; the sound continues without a step and dies away as this sphere's
  /// does. [audio-thread]
  void take_over(const AccelerationNoise& other) noexcept;
  std::int64_t get_refused() const { return refused_; }

 private:
  using Complex = std::complex<double>;
  struct Pulse {
    double begin = 0.0, length = 0.0;  // of the time when its force is not zero, in samples
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
  int substeps_ = 1;                     // per sample, so that the answer within one is smooth
  Complex turn_;                         // e^{(-1 + i) h c / a} of one sample
  std::array<Complex, kMoments> force_;  // Chebyshev coefficients of the answer within a substep
  Complex sub_turn_;
  std::array<Complex, 3> state_{};  // (q' + q c / a) + i q c / a along x, y, z
  std::vector<Pulse> pulses_;       // capacity max_strikes, never grown
  std::vector<Steps> forces_;       // capacity max_forces, never grown
  std::int64_t position_ = 0;
  std::int64_t refused_ = 0;
  bool awake_ = false;
};

}  // namespace carillon::synth
