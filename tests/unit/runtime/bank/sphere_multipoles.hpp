// Multipoles of a pulsating and oscillating sphere in closed form.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <utility>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank::example {

/// Normal velocity of the sphere's surface for unit modal velocity: pulse + shake . n [kg^-1/2].
struct SphereMotion {
  double pulse = 0.0;
  Vec3 shake{};
};

/// Appends a mode that moves the whole sphere of the multipoles in this way, at `freq_hz`. x = k R. Impedances, decays and added masses of
/// the pulsating and the oscillating sphere: Pierce 1981, sections 4.1 and 4.2, time factor e^{-i omega t}:
///   p / v = rho c (x^2 - i x) / (1 + x^2),     p / (v cos theta) = rho c (x^4 - i x (2 + x^2)) / (4 + x^4)
/// `order` is 1 or more, or 0 for a sphere that does not oscillate; higher coefficients are 0.
inline void add_sphere_mode(Multipoles& air, double freq_hz, const SphereMotion& motion, std::int32_t order) {
  const double pi = std::numbers::pi, omega = 2.0 * pi * freq_hz, x = omega / air.sound_speed_ms * air.radius_m;
  const double impedance = air.air_density_kg_m3 * air.sound_speed_ms, area = 4.0 * pi * air.radius_m * air.radius_m;
  const std::complex<double> pulse = std::complex(x * x, -x) / (1.0 + x * x);
  const std::complex<double> shake = std::complex(std::pow(x, 4), -x * (2.0 + x * x)) / (4.0 + std::pow(x, 4));
  std::vector<std::complex<double>> a((order + 1) * (order + 1));
  a[0] = impedance * motion.pulse * std::sqrt(4.0 * pi) * pulse;
  for (const auto& [place, axis] : {std::pair(1, 1), std::pair(2, 2), std::pair(3, 0)})  // Y_1m along y, z, x
    if (order > 0) a[place] = impedance * motion.shake[axis] * std::sqrt(4.0 * pi / 3.0) * shake;
  add_coefficients(air, order, a);
  const double pulses = area * motion.pulse * motion.pulse,
               shakes = area / 3.0 * dot(motion.shake, motion.shake);  // integrals of v^2 over the area
  air.freq_hz.push_back(freq_hz);
  air.decay_per_s.push_back(0.5 * impedance * (pulses * pulse.real() + shakes * shake.real()));
  air.added_mass.push_back(-impedance / omega * (pulses * pulse.imag() + shakes * shake.imag()));
  air.error_db.push_back(-45.0 - static_cast<double>(air.error_db.size()));
}

/// Multipoles without modes about the centre of the bounding box of a bank.
inline Multipoles make_air(const Bank& bank) {
  Multipoles air;
  for (std::size_t c = 0; c < 3; ++c) {
    const auto [low, high] =
        std::minmax_element(bank.vertices_m.begin(), bank.vertices_m.end(), [&](const Vec3& a, const Vec3& b) { return a[c] < b[c]; });
    air.centre_m[c] = 0.5 * ((*low)[c] + (*high)[c]);
  }
  for (const Vec3& x : bank.vertices_m) air.radius_m = std::max(air.radius_m, norm(x - air.centre_m));
  air.nearest_m = 1.5 * air.radius_m;
  air.air_density_kg_m3 = 1.21;
  air.sound_speed_ms = 343.0;
  air.method = "made up: a sphere";
  return air;
}

/// Adds multipoles to all modes, of orders 1 to 4 in turn, as if the sphere pulsated and oscillated; every second mode is a quarter lower
/// in air than in vacuum, so that the order of modes changes.
inline void add_multipoles(Bank& bank) {
  bank.multipoles = make_air(bank);
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    const double own = bank.corrected.is_empty() ? bank.freq_hz(m) : bank.corrected.freq_hz[m], i = static_cast<double>(m);
    add_sphere_mode(bank.multipoles, m % 2 == 1 ? 0.75 * own : 0.999 * own,
                    {0.2 + 0.1 * i, {0.3 * std::sin(i), 0.5 * std::cos(i), 0.4 - 0.05 * i}}, 1 + static_cast<std::int32_t>(m % 4));
  }
}

}  // namespace carillon::bank::example
