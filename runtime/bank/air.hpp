// Radiation damping and radiation gain of a mode.
#pragma once

#include <cmath>
#include <numbers>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

/// Decay [1/s] by radiation of a mode with far-field amplitude `gain` q' at 1 m (rms over directions): radiated power
/// 4 pi (g q')^2 / (2 rho c) over the energy q'^2 / 2, d_r = 2 pi g^2 / (rho c).
constexpr double calc_radiation_decay(double gain) noexcept {
  return 2.0 * std::numbers::pi * gain * gain / (kAirDensityKgM3 * kSoundSpeedMs);
}

/// Gain of an omnidirectional mode with this radiation decay [1/s] >= 0 in air of this density and speed of sound: rms over directions of
/// the far field at 1 m for unit modal velocity [Pa s m^-1 kg^-1/2]. Inverse of calc_radiation_decay() for the constants of the air.
inline double calc_gain_of_decay(double decay_per_s, double air_density_kg_m3, double sound_speed_ms) noexcept {
  return std::sqrt(air_density_kg_m3 * sound_speed_ms * decay_per_s / (2.0 * std::numbers::pi));
}

}  // namespace carillon::bank
