// Method: calc_entry(): Kaiser window. Others: least squares of the response error over pass band and stop band, of both stages together
//   for the motion, relative for derivatives, with weight 1e-7 at other frequencies to keep the weights small; normal equations, L D L^T.
// Source: Kaiser 1974; docs/equations.md E14.
#include "precompute/simulation/emission/weights.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace carillon::emission {
namespace {

constexpr double kEntryBeta = 9.5;

/// Kaiser window, |x| <= 1.
double calc_window(double beta, double x) {
  const auto calc_bessel_i0 = [](double y) {
    double term = 1.0, sum = 1.0;
    for (int k = 1; term > 1e-17 * sum; ++k) {
      term *= 0.25 * y * y / (static_cast<double>(k) * k);
      sum += term;
    }
    return sum;
  };
  return calc_bessel_i0(beta * std::sqrt(std::max(0.0, 1.0 - x * x))) / calc_bessel_i0(beta);
}

/// Response of calc_entry() at f times the sample rate, f <= 1; 1 at 0.
double calc_entry_response(double f) {
  const double at = std::numbers::pi * kEntry * 0.5 * f, root = std::sqrt(kEntryBeta * kEntryBeta - at * at);
  return std::sinh(root) / root * kEntryBeta / std::sinh(kEntryBeta);
}

/// Desired response at a frequency, and the weight of its error.
struct Wish {
  double response, share;
};

/// Weights that minimise the error of sum weight[n] row[n] of find(f, row) for all f up to `top` times the sample rate.
template <std::size_t kCount, typename Find>
std::array<double, kCount> fit(double top, Find&& find) {
  constexpr int kPoints = 250;
  std::array<std::array<double, kCount>, kCount> a{};
  std::array<double, kCount> b{}, row;
  for (int i = 0; i < kPoints; ++i) {
    const Wish wish = find(top * (i + 0.5) / kPoints, row);
    for (std::size_t n = 0; n < kCount; ++n) {
      b[n] += wish.share * wish.response * row[n];
      for (std::size_t m = 0; m <= n; ++m) a[n][m] += wish.share * row[n] * row[m];
    }
  }
  for (std::size_t j = 0; j < kCount; ++j)
    for (std::size_t n = j; n < kCount; ++n) {
      for (std::size_t m = 0; m < j; ++m) a[n][j] -= a[n][m] * a[m][m] * a[j][m];
      if (n > j) a[n][j] /= a[j][j];
    }
  for (std::size_t n = 0; n < kCount; ++n)
    for (std::size_t m = 0; m < n; ++m) b[n] -= a[n][m] * b[m];
  for (std::size_t n = 0; n < kCount; ++n) b[n] /= a[n][n];
  for (std::size_t n = kCount; n-- > 0;)
    for (std::size_t m = n + 1; m < kCount; ++m) b[n] -= a[m][n] * b[m];
  return b;
}

constexpr double kTransitionWeight = 1e-7;  // weight of frequencies between the bands

Wish wish_motion(double f) {
  if (f < 0.42) return {1.0, 1.0};
  return {0.0, f > 0.58 ? 1.0 : kTransitionWeight};
}

}  // namespace

double calc_entry(double x) { return calc_window(kEntryBeta, 2.0 / kEntry * x); }

MotionWeights make_motion_weights() {
  using std::numbers::pi;
  MotionWeights made;
  made.even = fit<kMotionHalf + 1>(1.0, [](double f, auto& row) {
    for (std::size_t n = 0; n < row.size(); ++n)
      row[n] = (n > 0 ? 2.0 : 1.0) * calc_entry_response(f) * std::cos(pi * f * static_cast<double>(n));
    return wish_motion(f);
  });
  const auto odd = fit<kMotionHalf>(1.0, [](double f, auto& row) {
    for (std::size_t n = 0; n < row.size(); ++n) row[n] = calc_entry_response(f) * std::sin(pi * f * static_cast<double>(n + 1)) / (pi * f);
    return wish_motion(f);
  });
  double sum = -made.even[0], slope = 0.0;
  for (const double one : made.even) sum += 2.0 * one;
  for (double& one : made.even) one /= sum;
  for (std::size_t n = 0; n < odd.size(); ++n) slope += static_cast<double>(n + 1) * odd[n];
  for (std::size_t n = 0; n < odd.size(); ++n) made.odd[n + 1] = odd[n] / slope;
  return made;
}

std::array<double, kDerivativeHalf + 1> make_derivative() {
  const auto odd = fit<kDerivativeHalf>(0.5, [](double f, auto& row) {
    const double omega = 2.0 * std::numbers::pi * f;
    for (std::size_t n = 0; n < row.size(); ++n) row[n] = 2.0 * std::sin(omega * static_cast<double>(n + 1)) / omega;
    return Wish{1.0, f < 0.425 ? 1.0 : kTransitionWeight};
  });
  double slope = 0.0;
  for (std::size_t n = 0; n < odd.size(); ++n) slope += 2.0 * static_cast<double>(n + 1) * odd[n];
  std::array<double, kDerivativeHalf + 1> weights{};
  for (std::size_t n = 0; n < odd.size(); ++n) weights[n + 1] = odd[n] / slope;
  return weights;
}

}  // namespace carillon::emission
