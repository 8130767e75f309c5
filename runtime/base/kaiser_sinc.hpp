// The sinc under a Kaiser window with which samples are read between their places.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

namespace carillon::base {

inline constexpr double kKaiserBeta = 9.0;  // stop band -90 dB

/// The modified Bessel function I0 by its power series (Abramowitz and Stegun 9.6.12), for 0 <= x <= kKaiserBeta: std::cyl_bessel_i is not
/// in every C++ library.
inline double calc_bessel_i0(double x) {
  double term = 1.0, sum = 1.0;
  for (int k = 1; term > 1e-17 * sum; ++k) {
    term *= 0.25 * x * x / (static_cast<double>(k) * k);
    sum += term;
  }
  return sum;
}

/// sin(pi x) / (pi x) under the window, at x samples from the middle, -half <= x <= half; calc_bessel_i0(kKaiserBeta) in the middle.
/// Kaiser 1974.
inline double calc_kaiser_sinc(double x, double half) {
  const double sinc = x == 0.0 ? 1.0 : std::sin(std::numbers::pi * x) / (std::numbers::pi * x);
  const double within = std::max(0.0, 1.0 - (x / half) * (x / half));
  return sinc * calc_bessel_i0(kKaiserBeta * std::sqrt(within));
}

}  // namespace carillon::base
