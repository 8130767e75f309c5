// Restitution of a ball on an infinite plate.
#pragma once

#include <algorithm>
#include <cmath>

namespace carillon::impact::tests {

/// Zener 1941 (Phys. Rev. 59, 669): s'' + (1 + lambda d/dt) s^1.5 = 0, s(0) = 0, s'(0) = 1; the speed at which s is 0 again. Runge-Kutta.
inline double calc_zener(double lambda) {
  const auto f = [](double x) { return x > 0 ? x * std::sqrt(x) : 0.0; };
  const auto rate = [&](double s, double u) { return u - lambda * f(s); };
  double s = 0, v = 1, peak = 0;
  const double h = 2e-4;
  for (double t = 0;; t += h) {
    const double k1 = rate(s, v), a1 = -f(s), k2 = rate(s + h / 2 * k1, v + h / 2 * a1), a2 = -f(s + h / 2 * k1),
                 k3 = rate(s + h / 2 * k2, v + h / 2 * a2), a3 = -f(s + h / 2 * k2), k4 = rate(s + h * k3, v + h * a3), a4 = -f(s + h * k3);
    const double s1 = s + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), v1 = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
    peak = std::max(peak, f(s1));
    if (s1 <= 0 || (f(s1) < 1e-7 * peak && t > 20)) return s1 <= 0 ? -(v + s / (s - s1) * (v1 - v)) : -v1;
    s = s1;
    v = v1;
  }
}

}  // namespace carillon::impact::tests
