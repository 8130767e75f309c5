// Where a function of one variable changes its sign.
// Source: M. Dowell, P. Jarratt, "A modified regula falsi method for computing the root of an equation" (1971): the Illinois method.
#pragma once

#include <cmath>

namespace carillon::base {

/// A place between `a` and `b` where the values `at_a` and `at_b` of a continuous function have opposite signs: where a value is at most
/// `min_value` in size, or what is left of the bracket is no longer than `min_way`, or after `max` values.
template <class Function>
double find_crossing(Function&& calc, double a, double at_a, double b, double at_b, double min_value, double min_way, int max) {
  for (int n = 0; n < max && std::abs(b - a) > min_way; ++n) {
    const double x = b - at_b * (b - a) / (at_b - at_a), at_x = calc(x);
    if (std::abs(at_x) <= min_value) return x;
    // The value of an end that stays is halved, so that both ends come closer.
    if ((at_x > 0) != (at_b > 0))
      a = b, at_a = at_b;
    else
      at_a *= 0.5;
    b = x, at_b = at_x;
  }
  return b;
}

}  // namespace carillon::base
