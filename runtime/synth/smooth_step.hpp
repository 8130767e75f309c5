// Smooth step.
#pragma once

#include <algorithm>

namespace carillon::synth {

/// 3 x^2 - 2 x^3; 0 below 0, 1 above 1.
inline double calc_smooth_step(double x) noexcept {
  x = std::clamp(x, 0.0, 1.0);
  return x * x * (3.0 - 2.0 * x);
}

}  // namespace carillon::synth
