// Method:     least squares of the relative error over the frequencies of the band, with a weight of 1e-7 on those above it, which keeps
// the
//             weights small; normal equations, L D L^T.
// Source:     docs/equations.md E14.
// Deviations: none.
#include "precompute/emission/derivative.hpp"

#include <cmath>
#include <cstddef>
#include <numbers>

namespace carillon::emission {
namespace {

using Weights = std::array<double, kDerivativeHalf + 1>;  // from [1] on

/// The weights for which the sum of weight[n] find(n, omega) is nearest to 1.
template <typename Find>
Weights fit(Find&& find) {
  constexpr std::size_t kCount = kDerivativeHalf;
  constexpr int kPoints = 1000;
  constexpr double kBand = 0.425 * 2.0 * std::numbers::pi;
  double a[kCount][kCount]{}, b[kCount]{};
  for (int i = 0; i < kPoints; ++i) {
    const double omega = std::numbers::pi * (i + 0.5) / kPoints, share = omega < kBand ? 1.0 : 1e-7;
    double row[kCount];
    for (std::size_t n = 0; n < kCount; ++n) row[n] = find(static_cast<double>(n + 1), omega);
    for (std::size_t n = 0; n < kCount; ++n) {
      b[n] += share * row[n];
      for (std::size_t m = 0; m <= n; ++m) a[n][m] += share * row[n] * row[m];
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
  Weights weights{};
  for (std::size_t n = 0; n < kCount; ++n) weights[n + 1] = b[n];
  return weights;
}

}  // namespace

Derivative make_derivative() {
  Derivative made;
  made.first = fit([](double n, double omega) { return 2.0 * std::sin(n * omega) / omega; });
  made.second = fit([](double n, double omega) { return 4.0 * std::pow(std::sin(0.5 * n * omega) / omega, 2); });
  double slope = 0.0;
  for (std::size_t n = 1; n <= kDerivativeHalf; ++n) slope += 2.0 * static_cast<double>(n) * made.first[n];
  for (double& one : made.first) one /= slope;
  for (std::size_t n = 1; n <= kDerivativeHalf; ++n) made.second[0] -= 2.0 * made.second[n];
  return made;
}

}  // namespace carillon::emission
