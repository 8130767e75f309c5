// What the air takes of a mode.
#pragma once

#include <cmath>
#include <numbers>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

/// The decay [1/s] that sound alone makes of a mode whose far field has the amplitude `gain` q' at 1 m, in the root mean square over all
/// directions: it carries away 4 pi (g q')^2 / (2 rho c) of the mode's q'^2 / 2, which is d_r = 2 pi g^2 / (rho c).
constexpr double calc_radiation_decay(double gain) noexcept {
  return 2.0 * std::numbers::pi * gain * gain / (kAirDensityKgM3 * kSoundSpeedMs);
}

/// The gain of a mode that sounds into all directions and decays so by that [1/s], 0 or more, in air of this density and speed of sound:
/// the root mean square over directions of the far field at 1 m, for unit modal velocity [Pa s m^-1 kg^-1/2]. In the air of the constants
/// it is the inverse of calc_radiation_decay().
inline double calc_gain_of_decay(double decay_per_s, double air_density_kg_m3, double sound_speed_ms) noexcept {
  return std::sqrt(air_density_kg_m3 * sound_speed_ms * decay_per_s / (2.0 * std::numbers::pi));
}

}  // namespace carillon::bank
