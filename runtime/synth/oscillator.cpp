// Method:     with s^2 = d^2 - lambda, C = e^{-dt} cosh(st) and S = e^{-dt} sinh(st) / s the map over t is q(t) = (C + d S) q0 + S v0,
//             q'(t) = -lambda S q0 + (C - d S) v0; for s^2 < 0 cosh and sinh become cos and sin. S is even in s and regular at s = 0, where
//             its series is used. Far above critical damping C - d S cancels; there the roots r = d + s and lambda / r (not d - s) are
//             used.
// Source:     closed form of the damped oscillator; docs/equations.md.
#include "runtime/synth/oscillator.hpp"

#include <cmath>

namespace carillon::synth {
namespace {

/// sin(sqrt(x)) / sqrt(x) for x >= 0 and sinh(sqrt(-x)) / sqrt(-x) for x < 0, |x| <= 0.25: the power series of both.
double calc_sinc_of_square(double x) {
  double term = 1.0;
  double sum = 1.0;
  for (int k = 1; k <= 8; ++k) {
    term *= -x / ((2.0 * k) * (2.0 * k + 1.0));
    sum += term;
  }
  return sum;
}

double calc_cos_of_square(double x) {
  double term = 1.0;
  double sum = 1.0;
  for (int k = 1; k <= 8; ++k) {
    term *= -x / ((2.0 * k - 1.0) * (2.0 * k));
    sum += term;
  }
  return sum;
}

OscillatorMap make_map(double c, double s, double lambda, double d) {
  return {.qq = c + d * s, .qv = s, .vq = -lambda * s, .vv = c - d * s};
}

}  // namespace

OscillatorMap calc_oscillator_map(double lambda, double decay_per_s, double time_s) noexcept {
  const double d = decay_per_s;
  const double omega = std::sqrt(lambda);
  const double s2 = (d - omega) * (d + omega);  // d^2 - lambda without cancellation of the squares
  const double x = -s2 * time_s * time_s;
  if (std::abs(x) <= 0.25) {
    const double decay = std::exp(-d * time_s);
    return make_map(decay * calc_cos_of_square(x), decay * time_s * calc_sinc_of_square(x), lambda, d);
  }
  if (s2 < 0.0) {
    const double decay = std::exp(-d * time_s);
    const double omega_d = std::sqrt(-s2);
    return make_map(decay * std::cos(omega_d * time_s), decay * std::sin(omega_d * time_s) / omega_d, lambda, d);
  }
  const double s = std::sqrt(s2);
  const double fast = d + s;
  const double slow = lambda / fast;  // d - s
  const double ef = std::exp(-fast * time_s);
  const double es = std::exp(-slow * time_s);
  const double width = 2.0 * s;
  return {.qq = (fast * es - slow * ef) / width,
          .qv = (es - ef) / width,
          .vq = -lambda * (es - ef) / width,
          .vv = (fast * ef - slow * es) / width};
}

}  // namespace carillon::synth
