// Weights of the filters between steps and the volume accelerations of triangles. Internal to carillon::emission.
#pragma once

#include <array>

#include "precompute/simulation/emission/loops.hpp"

namespace carillon::emission {

/// The weight of a step in a half-sample x half-samples away, |x| <= kEntry / 2: a Kaiser window, whose images in the band are at -68 dB.
double calc_entry(double x);

/// Places and velocities of samples from half-samples, per sample: x = even[0] y_0 + the sum of even[j] (y_j + y_-j), v = the sum of
/// odd[j] (y_j - y_-j). Of steps, with calc_entry(): flat within 0.01 dB to 5/12 of the sample rate, -64 dB from 7/12 on. Exact for uniform
/// motion.
struct MotionWeights {
  std::array<double, kMotionHalf + 1> even{}, odd{};
};
MotionWeights make_motion_weights();

/// Weights of the derivative per sample, the sum over j >= 1 of weight[j] (x_j - x_-j): within 0.05 % of any tone to 0.42 of the sample
/// rate; exact for a line.
std::array<double, kDerivativeHalf + 1> make_derivative();

}  // namespace carillon::emission
