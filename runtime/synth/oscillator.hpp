// Exact map of (q, q') of one mode over a time, in all three damping regimes.
#pragma once

#include <cmath>

namespace carillon::synth {

/// Damped angular frequency [rad/s] of an under-damped mode.
inline double calc_damped_omega(double lambda, double decay_per_s) noexcept {
  const double omega = std::sqrt(lambda);
  return std::sqrt((omega - decay_per_s) * (omega + decay_per_s));
}

/// Map of a damped oscillator over a time t: q(t) = qq q(0) + qv q'(0), q'(t) = vq q(0) + vv q'(0). (qv, vv) is the response to a unit
/// impulse: q(0) = 0, q'(0) = 1.
struct OscillatorMap {
  double qq = 1.0, qv = 0.0;
  double vq = 0.0, vv = 1.0;
};

/// Map of q'' + 2 d q' + lambda q = 0 over `time_s` >= 0. lambda >= 0 in rad^2/s^2, d = decay_per_s >= 0 in 1/s. Exact to rounding for
/// under-damped, critical and over-damped modes, and near critical damping. Pure; any thread.
OscillatorMap calc_oscillator_map(double lambda, double decay_per_s, double time_s) noexcept;

}  // namespace carillon::synth
