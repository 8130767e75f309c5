// Positive definite matrices.
#pragma once

#include <cmath>

#include "runtime/base/vector.hpp"

namespace carillon {

/// Sylvester's criterion for a symmetric matrix, with a tolerance relative to the trace. False for NaN.
inline bool is_positive_definite(const Mat3& m, double tolerance = 0.0) {
  const double trace = m[0][0] + m[1][1] + m[2][2];
  return std::isfinite(trace) && m[0][0] > tolerance * trace && m[0][0] * m[1][1] - m[0][1] * m[1][0] > tolerance * trace * trace &&
         calc_det(m[0], m[1], m[2]) > tolerance * trace * trace * trace;
}

}  // namespace carillon
