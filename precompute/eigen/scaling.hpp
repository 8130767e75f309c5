// K and M in units in which the band ends near 1.
#pragma once

#include <petscmat.h>

#include <array>
#include <cmath>
#include <cstdint>

namespace carillon::eigen {

/// K and M times powers of two, so that lambda is about 1 at the upper end of the band and M about 1: thresholds of the solvers then mean
/// what they say. Powers of two change no mantissa; the destructor restores every bit. Making and destroying one is collective.
class Scaling {
 public:
  /// lambda_high: eigenvalue that becomes about 1. Throws SolveError when M has no positive trace.
  Scaling(Mat stiffness, Mat mass, double lambda_high);
  ~Scaling();
  Scaling(const Scaling&) = delete;
  Scaling& operator=(const Scaling&) = delete;

  double to_scaled(double lambda) const { return std::ldexp(lambda, -lambda_power_); }
  double from_scaled(double lambda) const { return std::ldexp(lambda, lambda_power_); }
  /// The powers of two, of M and of lambda.
  std::array<std::int64_t, 2> get_powers() const { return {mass_power_, lambda_power_}; }
  /// A scaled mode shape times this is one in the units of M.
  double get_shape_factor() const { return std::ldexp(1.0, -mass_power_ / 2); }

 private:
  void scale(int direction);

  Mat stiffness_ = nullptr;
  Mat mass_ = nullptr;
  int mass_power_ = 0;  // even: its root is a power of two as well
  int lambda_power_ = 0;
};

}  // namespace carillon::eigen
