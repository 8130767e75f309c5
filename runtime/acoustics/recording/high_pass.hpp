// The DC blocker of OCE01 eq. 9; docs/equations.md E14.
#pragma once

#include <cmath>
#include <numbers>

namespace carillon::recording {

/// alpha of a corner frequency (-3 dB): 1 - exp(-2 pi f / fs); 0 Hz: pass-through.
inline double calc_alpha(double corner_hz, double sample_rate_hz) {
  return -std::expm1(-2.0 * std::numbers::pi * corner_hz / sample_rate_hz);
}

/// p_i = (1 - alpha) p_{i-1} + g_i - g_{i-1}, p_0 = 0: a constant from the beginning is silent.
struct HighPass {
  double g = 0.0, p = 0.0;
  bool has_begun = false;

  double next(double value, double alpha) {
    if (alpha == 0.0) return value;
    p = has_begun ? (1.0 - alpha) * p + (value - g) : 0.0;
    g = value;
    has_begun = true;
    return p;
  }
};

}  // namespace carillon::recording
