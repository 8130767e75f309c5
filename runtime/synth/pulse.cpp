// Method:     the answer of a mode to a force f during one sample is the integral of E(1 - u) f(u), E being the mode's answer to an
// impulse.
//             E is written as a short Chebyshev series once per mode; then only the moments of f against the Chebyshev polynomials are
//             needed, the same few numbers for all modes. The moments are Gauss-Legendre sums in theta with x = (1 - cos theta) / 2, which
//             turns the root singularity of sin^1.5 at both ends of the pulse into a smooth function.
// Source:     pulse shape: Hunt & Crossley 1975; product integration: Davis & Rabinowitz, Methods of Numerical Integration, 2.5.6.
// Deviations: OSG02 convolves with a Gaussian of the same area, which never begins; this pulse begins and ends.
#include "runtime/synth/pulse.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace carillon::synth {
namespace {

using std::numbers::pi;

// 1 / integral of sin(pi x)^1.5 over 0 <= x <= 1 = sqrt(pi) Gamma(7/4) / Gamma(5/4).
const double kPulseNorm = std::sqrt(pi) * std::tgamma(1.75) / std::tgamma(1.25);

constexpr int kGauss = 24;
struct GaussRule {
  std::array<double, kGauss> node;    // in 0..1
  std::array<double, kGauss> weight;  // sums to 1
};

/// Gauss-Legendre on 0..1 by Newton's method on the Legendre polynomial.
GaussRule make_gauss_rule() {
  GaussRule rule{};
  for (int i = 0; i < kGauss; ++i) {
    double x = std::cos(pi * (i + 0.75) / (kGauss + 0.5));
    double slope = 1.0;
    for (int iteration = 0; iteration < 20; ++iteration) {
      double p = 1.0, previous = 0.0;
      for (int n = 0; n < kGauss; ++n) {
        const double next = ((2.0 * n + 1.0) * x * p - n * previous) / (n + 1.0);
        previous = p;
        p = next;
      }
      slope = kGauss * (x * p - previous) / (x * x - 1.0);
      x -= p / slope;
    }
    rule.node[i] = 0.5 * (1.0 + x);
    rule.weight[i] = 1.0 / ((1.0 - x * x) * slope * slope);
  }
  return rule;
}

const GaussRule kRule = make_gauss_rule();
constexpr double kShortest = 1e-9;

}  // namespace

double calc_pulse(double x) noexcept {
  if (!(x > 0.0 && x < 1.0)) return 0.0;
  const double s = std::sin(pi * x);
  return kPulseNorm * s * std::sqrt(s);
}

Moments calc_chebyshev(double u) noexcept {
  const double x = 2.0 * u - 1.0;
  Moments t{};
  t[0] = 1.0;
  t[1] = x;
  for (int j = 2; j < kMoments; ++j) t[j] = 2.0 * x * t[j - 1] - t[j - 2];
  return t;
}

Moments calc_pulse_moments(double start, double duration) noexcept {
  if (duration < kShortest) return start > 0.0 && start <= 1.0 ? calc_chebyshev(start) : Moments{};
  const double from = std::clamp(-start / duration, 0.0, 1.0);
  const double to = std::clamp((1.0 - start) / duration, 0.0, 1.0);
  Moments moments{};
  if (!(to > from)) return moments;
  const double theta_from = std::acos(1.0 - 2.0 * from);
  const double theta_to = std::acos(1.0 - 2.0 * to);
  for (int i = 0; i < kGauss; ++i) {
    const double theta = theta_from + (theta_to - theta_from) * kRule.node[i];
    const double cosine = std::cos(theta);
    const double force = std::cos(0.5 * pi * cosine);  // sin(pi x)
    const double weight =
        kRule.weight[i] * (theta_to - theta_from) * 0.5 * std::sin(theta) * kPulseNorm * force * std::sqrt(std::max(force, 0.0));
    const Moments t = calc_chebyshev(start + duration * 0.5 * (1.0 - cosine));
    for (int j = 0; j < kMoments; ++j) moments[j] += weight * t[j];
  }
  return moments;
}

std::array<double, kMoments> get_chebyshev_points() noexcept {
  std::array<double, kMoments> points{};
  for (int k = 0; k < kMoments; ++k) points[k] = 0.5 * (1.0 + std::cos(pi * (k + 0.5) / kMoments));
  return points;
}

Moments calc_chebyshev_coefficients(const std::array<double, kMoments>& values) noexcept {
  Moments coefficients{};
  for (int j = 0; j < kMoments; ++j) {
    double sum = 0.0;
    for (int k = 0; k < kMoments; ++k) sum += values[k] * std::cos(pi * j * (k + 0.5) / kMoments);
    coefficients[j] = sum * (j == 0 ? 1.0 : 2.0) / kMoments;
  }
  return coefficients;
}

}  // namespace carillon::synth
