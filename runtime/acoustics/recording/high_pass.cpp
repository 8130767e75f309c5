// Source:     OCE01 eq. 9; docs/equations.md E14.
#include "runtime/acoustics/recording/high_pass.hpp"

#include <cmath>
#include <numbers>

namespace carillon::recording {

double calc_alpha(double corner_hz, double sample_rate_hz) { return -std::expm1(-2.0 * std::numbers::pi * corner_hz / sample_rate_hz); }

}  // namespace carillon::recording
