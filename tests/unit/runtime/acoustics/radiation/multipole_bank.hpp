// Banks with multipoles of known fields in closed form.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdint>
#include <numbers>
#include <span>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::testing {

using Complex = std::complex<double>;

inline constexpr double kSphereRadius = 0.1;
inline constexpr Vec3 kSphereCentre{0.3, -0.2, 0.1};

/// h_l(x) e^{-i x} as its finite sum (DLMF 10.49.6), where its terms do not cancel: x below 1, or l below 20.
inline std::complex<long double> calc_hankel(int l, long double x) {
  using Long = std::complex<long double>;
  const Long i(0.0L, 1.0L);
  Long term = 1.0L, sum = 1.0L;
  for (int j = 1; j <= l; ++j) {
    term *= i * static_cast<long double>(l + j) * static_cast<long double>(l - j + 1) / (2.0L * x * static_cast<long double>(j));
    sum += term;
  }
  for (int j = 0; j <= l; ++j) sum *= -i;
  return sum / x;
}

/// Real orthonormal harmonic of a unit vector by the C++ library, whose functions include (-1)^m.
inline double calc_harmonic(int l, int m, const Vec3& direction) {
  const double turn = std::atan2(direction[1], direction[0]), angle = std::acos(std::clamp(direction[2], -1.0, 1.0));
  const int order = std::abs(m);
  const double legendre = (order % 2 == 0 ? 1.0 : -1.0) * std::sph_legendre(static_cast<unsigned>(l), static_cast<unsigned>(order), angle);
  if (m == 0) return legendre;
  return std::numbers::sqrt2 * legendre * (m > 0 ? std::cos(order * turn) : std::sin(order * turn));
}

/// Bank without modes, multipoles about kSphereCentre.
inline bank::Bank make_empty_multipoles() {
  bank::Bank bank;
  bank.multipoles.centre_m = kSphereCentre;
  bank.multipoles.radius_m = bank.multipoles.nearest_m = kSphereRadius;
  bank.multipoles.air_density_kg_m3 = bank::kAirDensityKgM3;
  bank.multipoles.sound_speed_ms = bank::kSoundSpeedMs;
  return bank;
}

/// Appends a mode with these (L + 1)^2 coefficients, rounded to 16 bits of the largest component, and an arbitrary decay.
inline void add_multipoles(bank::Bank& bank, double ka, std::span<const Complex> coefficients) {
  bank::Multipoles& air = bank.multipoles;
  const double freq_hz = ka / kSphereRadius * bank::kSoundSpeedMs / (2.0 * std::numbers::pi);
  bank.eigenvalue_rad2_s2.push_back(std::pow(2.0 * std::numbers::pi * freq_hz, 2));
  air.freq_hz.push_back(freq_hz);
  bank::add_coefficients(air, static_cast<std::int32_t>(std::lround(std::sqrt(static_cast<double>(coefficients.size())))) - 1,
                         coefficients);
  air.decay_per_s.push_back(1.0);
  air.added_mass.push_back(0.0);
  air.error_db.push_back(-60.0);
}

/// Multipoles of e^{i k s} / (4 pi s), s the distance from `source`, relative to the centre and inside the sphere: by the addition theorem
/// i k sum of j_l(k |source|) h_l(k r) Y_lm(source) Y_lm(place).
inline std::vector<Complex> calc_monopole(double ka, const Vec3& source, int order) {
  const double k = ka / kSphereRadius, size = norm(source);
  std::vector<Complex> coefficients;
  for (int l = 0; l <= order; ++l) {
    const auto n = static_cast<unsigned>(l);
    // j_l times h_l; below x = 1 by the leading terms of their series, since the factors themselves leave the range of numbers.
    Complex product;
    if (ka < 1e-3) {
      product = Complex(0.0, -std::pow(size / kSphereRadius, l) / (ka * (2.0 * l + 1.0)));
    } else {
      product = std::sph_bessel(n, k * size) * Complex(std::sph_bessel(n, ka), std::sph_neumann(n, ka));
    }
    for (int m = -l; m <= l; ++m) coefficients.push_back(Complex(0.0, k) * product * calc_harmonic(l, m, (1.0 / size) * source));
  }
  return coefficients;
}

}  // namespace carillon::testing
