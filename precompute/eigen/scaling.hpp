// Scaling of K and M such that the band ends near 1.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "precompute/la/pencil.hpp"

namespace carillon::eigen {

/// Powers of two that scale lambda to about 1 at the upper end of the band and M to about 1, so that absolute thresholds of the solvers
/// apply. They change no mantissa and no matrix.
class Scaling {
 public:
  /// lambda_high: eigenvalue that becomes about 1. Collective. Throws SolveError when M has no positive trace.
  Scaling(Mat mass, double lambda_high);

  /// K and M in these units.
  la::Pencil scale(Mat stiffness, Mat mass) const {
    return {stiffness, mass, std::ldexp(1.0, -(mass_power_ + lambda_power_)), std::ldexp(1.0, -mass_power_)};
  }
  double to_scaled(double lambda) const { return std::ldexp(lambda, -lambda_power_); }
  double from_scaled(double lambda) const { return std::ldexp(lambda, lambda_power_); }
  /// The powers of two, of M and of lambda.
  std::array<std::int64_t, 2> get_powers() const { return {mass_power_, lambda_power_}; }
  /// A scaled mode shape times this is one in the units of M.
  double get_shape_factor() const { return std::ldexp(1.0, -mass_power_ / 2); }

 private:
  int mass_power_ = 0;  // even: its square root is a power of two as well
  int lambda_power_ = 0;
};

}  // namespace carillon::eigen
