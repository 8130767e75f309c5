// Bracketed root finding (Illinois method).
// Source: M. Dowell, P. Jarratt, "A modified regula falsi method for computing the root of an equation" (1971).
#pragma once

#include <cmath>

namespace carillon::base {

/// Root of a continuous function between `a` and `b`, whose values `at_a` and `at_b` have opposite signs. Stops at |value| <= min_value,
/// at a bracket no longer than min_way, or after `max` evaluations.
template <class Function>
double find_crossing(Function&& calc, double a, double at_a, double b, double at_b, double min_value, double min_way, int max) {
  for (int n = 0; n < max && std::abs(b - a) > min_way; ++n) {
    const double x = b - at_b * (b - a) / (at_b - at_a), at_x = calc(x);
    if (std::abs(at_x) <= min_value) return x;
    // Illinois: halve the value of the retained end, so that both ends converge.
    if ((at_x > 0) != (at_b > 0))
      a = b, at_a = at_b;
    else
      at_a *= 0.5;
    b = x, at_b = at_x;
  }
  return b;
}

}  // namespace carillon::base
