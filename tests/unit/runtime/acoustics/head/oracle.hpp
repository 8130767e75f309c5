// Oracles of head tests: the field around a rigid sphere by the special functions of the C++ library, and spectra of filter outputs.
#pragma once

#include <cmath>
#include <complex>
#include <cstddef>
#include <numbers>
#include <span>
#include <vector>

#include "runtime/acoustics/head/ear_filter.hpp"

namespace carillon::head::testing {

using Complex = std::complex<double>;
inline constexpr double kSoundSpeedMs = 343.0;

/// Pressure on a rigid sphere in a plane wave at an angle from the source, incident plus scattered (Morse and Ingard 1968, 8.2), over that
/// at its centre. Time as exp(+i omega t).
inline Complex calc_rigid_sphere(double ka, double angle_rad) {
  const Complex i(0.0, 1.0);
  Complex sum = 0.0, turn = 1.0;
  const auto orders = static_cast<unsigned>(ka + 12.0 + 6.0 * std::cbrt(ka));
  for (unsigned m = 0; m <= orders; ++m) {
    const auto hankel = [&](unsigned n) { return Complex(std::sph_bessel(n, ka), -std::sph_neumann(n, ka)); };
    const Complex slope = m == 0 ? -hankel(1) : hankel(m - 1) - (m + 1.0) / ka * hankel(m);
    sum += (2.0 * m + 1.0) * turn * std::legendre(m, std::cos(angle_rad)) * (std::sph_bessel(m, ka) - slope.real() / slope * hankel(m));
    turn *= i;
  }
  return sum;
}

/// Response of both ears to one sample of 1 Pa from a constant direction.
struct Heard {
  std::vector<double> left, right;
};
inline Heard hear_pulse(const std::shared_ptr<const Head>& head, const Vec3& direction) {
  EarFilter filter(head);
  const std::size_t length = head->get_taps() + head->get_max_delay() + 2 * kSincTaps;
  Heard heard{std::vector<double>(length), std::vector<double>(length)};
  std::vector<double> pulse(length);
  pulse[0] = 1.0;
  filter.process(direction, pulse, heard.left, heard.right);
  return heard;
}

/// Spectrum with sample `latency` at time 0.
inline Complex calc_spectrum(std::span<const double> samples, double freq_hz, double sample_rate_hz, double latency) {
  Complex sum = 0.0;
  for (std::size_t n = 0; n < samples.size(); ++n)
    sum += samples[n] * std::polar(1.0, -2.0 * std::numbers::pi * freq_hz * (static_cast<double>(n) - latency) / sample_rate_hz);
  return sum;
}

/// Direction of a source at an azimuth to the left and an elevation [degrees].
inline Vec3 make_direction(double azimuth_deg, double elevation_deg) {
  constexpr double kRad = std::numbers::pi / 180.0;
  return {std::cos(elevation_deg * kRad) * std::cos(azimuth_deg * kRad), std::cos(elevation_deg * kRad) * std::sin(azimuth_deg * kRad),
          std::sin(elevation_deg * kRad)};
}

}  // namespace carillon::head::testing
