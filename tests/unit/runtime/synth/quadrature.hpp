// Numerical integration: oracle of the pulse tests.
#pragma once

#include <cmath>
#include <complex>
#include <numbers>

namespace carillon::testing {

/// Integral of f over a..b by the double-exponential rule, for root singularities at the ends.
template <typename F>
auto integrate(F f, double a, double b) {
  const double step = 1.0 / 64.0;
  decltype(f(a)) sum{};
  for (int k = -64 * 4; k <= 64 * 4; ++k) {
    const double s = k * step;
    const double u = 0.5 * std::numbers::pi * std::sinh(s);
    const double x = 0.5 * (a + b) + 0.5 * (b - a) * std::tanh(u);
    const double weight = 0.5 * (b - a) * 0.5 * std::numbers::pi * std::cosh(s) / (std::cosh(u) * std::cosh(u));
    if (x > a && x < b) sum += f(x) * (weight * step);
  }
  return sum;
}

/// sin(pi x)^1.5 of unit area, by quadrature.
inline double calc_reference_pulse(double x) {
  static const double area = integrate([](double y) { return std::pow(std::sin(std::numbers::pi * y), 1.5); }, 0.0, 1.0);
  return x <= 0.0 || x >= 1.0 ? 0.0 : std::pow(std::sin(std::numbers::pi * x), 1.5) / area;
}

}  // namespace carillon::testing
