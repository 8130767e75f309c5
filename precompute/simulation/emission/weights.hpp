// Filter weights between steps and volume accelerations of triangles. Internal to carillon::emission.
#pragma once

#include <array>

#include "precompute/simulation/emission/loops.hpp"

namespace carillon::emission {

/// Weight of a step at a distance of x half-samples, |x| <= kEntry / 2: Kaiser window, in-band images at -68 dB.
double calc_entry(double x);

/// Positions and velocities of samples from half-samples: x = even[0] y_0 + sum even[j] (y_j + y_-j), v = sum odd[j] (y_j - y_-j). With
/// calc_entry(): flat within 0.01 dB to 5/12 of the sample rate, -64 dB from 7/12 on. Exact for uniform motion.
struct MotionWeights {
  std::array<double, kMotionHalf + 1> even{}, odd{};
};
MotionWeights make_motion_weights();

/// Weights of the derivative per sample, sum over j >= 1 of weight[j] (x_j - x_-j): within 0.05 % for tones up to 0.42 of the sample rate;
/// exact for linear motion.
std::array<double, kDerivativeHalf + 1> make_derivative();

}  // namespace carillon::emission
