// Multipoles for the bank of cube_bank.hpp.
#pragma once

#include <cmath>
#include <complex>
#include <cstdint>
#include <numbers>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::testing {

/// a_lm of a mode at l^2 + l + m, sign convention e^{-i omega t}.
using ModeMultipoles = std::vector<std::complex<double>>;

inline constexpr double kAirDensity = 1.2;

/// Sets multipoles about `centre_m`, on the sphere of this radius, rounded to 1 / 32767 of the largest of a mode.
inline void give_multipoles(bank::Bank& bank, const std::vector<ModeMultipoles>& modes, double radius_m, const Vec3& centre_m = {}) {
  bank::Multipoles& air = bank.multipoles;
  air = {};
  air.centre_m = centre_m;
  air.radius_m = air.nearest_m = radius_m;
  air.air_density_kg_m3 = kAirDensity;
  air.sound_speed_ms = bank::kSoundSpeedMs;
  for (std::size_t m = 0; m < modes.size(); ++m) {
    air.freq_hz.push_back(std::sqrt(bank.eigenvalue_rad2_s2[m]) / (2.0 * std::numbers::pi));
    bank::add_coefficients(air, static_cast<std::int32_t>(std::lround(std::sqrt(static_cast<double>(modes[m].size())))) - 1, modes[m]);
    air.decay_per_s.push_back(0.0);
    air.added_mass.push_back(0.0);
    air.error_db.push_back(-60.0);
  }
  air.method = "by hand";
}

/// Monopole equivalent to a gain at 1 m.
inline ModeMultipoles make_monopole(double gain, double freq_hz, double radius_m) {
  const double k = 2.0 * std::numbers::pi * freq_hz / bank::kSoundSpeedMs;
  return {gain / radius_m * std::sqrt(4.0 * std::numbers::pi) * std::polar(1.0, k * radius_m)};
}

/// Dipole along z, pressure on the sphere `pressure` times the cosine.
inline ModeMultipoles make_dipole(std::complex<double> pressure) {
  return {0.0, 0.0, pressure * std::sqrt(4.0 * std::numbers::pi / 3.0), 0.0};
}

/// h_1(x) / h_1(y), h_1 = -e^{ix} (x + i) / x^2 (DLMF 10.49.6).
inline std::complex<double> calc_dipole_fall(double x, double y) {
  const std::complex<double> i(0.0, 1.0);
  return std::exp(i * (x - y)) * (x + i) / (y + i) * (y * y) / (x * x);
}

}  // namespace carillon::testing
