// Damped frequency.
#pragma once

#include <cmath>
#include <numbers>

namespace carillon::exchange {

/// sqrt(omega^2 - d^2) / 2 pi [Hz]; 0 for over-damped modes and within rounding of critical damping (omega - d below 1e-6 omega).
inline double calc_damped_hz(double omega_rad_s, double decay_per_s) {
  constexpr double kLost = 1e-6;
  const double gap = omega_rad_s - decay_per_s;
  return gap > kLost * omega_rad_s ? std::sqrt(gap * (omega_rad_s + decay_per_s)) / (2.0 * std::numbers::pi) : 0.0;
}

}  // namespace carillon::exchange
