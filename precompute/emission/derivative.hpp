// Velocities and accelerations of sampled motion. Internal to carillon::emission.
#pragma once

#include <array>

#include "precompute/emission/loops.hpp"

namespace carillon::emission {

/// Weights per sample: v = the sum over j >= 1 of first[j] (x_j - x_-j), a = second[0] x_0 + the sum of second[j] (x_j + x_-j). Within
/// 0.05 % of the exact derivatives of any tone to 0.42 of the sample rate; exact for uniform motion.
struct Derivative {
  std::array<double, kDerivativeHalf + 1> first{}, second{};
};

Derivative make_derivative();

}  // namespace carillon::emission
