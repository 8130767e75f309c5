// Lamb's frequency equations of the free solid sphere (Lamb 1882; Eringen and Suhubi 1975, "Elastodynamics" vol. 2, section 8.14), solved
// by bisection with the standard library's Bessel functions. k = omega radius / c_T.
#pragma once

#include <cmath>
#include <stdexcept>

namespace carillon::tests {

/// Frequency equation of the spheroidal modes of degree n at k.
inline double calc_spheroidal(unsigned n, double k, double nu) {
  const auto j = [](unsigned degree, double x) { return std::sph_bessel(degree, x); };
  const double h = k * std::sqrt((1 - 2 * nu) / (2 - 2 * nu));
  const double t11 = (n * n - n - k * k / 2) * j(n, h) + 2 * h * j(n + 1, h), t13 = n * (n + 1) * ((n - 1) * j(n, k) - k * j(n + 1, k));
  const double t41 = (n - 1) * j(n, h) - h * j(n + 1, h), t43 = (n * n - 1 - k * k / 2) * j(n, k) + k * j(n + 1, k);
  return t11 * t43 - t13 * t41;
}

template <class Function>
double find_root(double low, double high, Function&& f) {
  if (f(low) * f(high) > 0) throw std::logic_error("no root between these");
  for (int i = 0; i < 60; ++i) {
    const double middle = (low + high) / 2;
    (f(low) * f(middle) <= 0 ? high : low) = middle;
  }
  return low;
}

/// Lowest spheroidal mode of degree 2.
inline double find_s2(double nu) {
  return find_root(2.2, 3.2, [&](double k) { return calc_spheroidal(2, k, nu); });
}

/// Lowest torsional mode of degree 2, independent of nu.
inline constexpr double kT2 = 2.5011326204094;

}  // namespace carillon::tests
