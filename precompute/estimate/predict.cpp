// Method: the parts of the estimate, added without letting them cancel, each with a safety factor, as a ratio of frequencies.
// Source: rates: Strang and Fix 1973, An Analysis of the Finite Element Method, ch. 6. Factors: measured, docs/error-bars.md.
// Deviations: none.
#include <algorithm>
#include <cmath>

#include "precompute/estimate/error_bars.hpp"

namespace carillon::estimate {

Solid make_isotropic(double young_modulus_pa, double poisson_ratio, double density_kg_m3) {
  const double lambda = young_modulus_pa * poisson_ratio / ((1 + poisson_ratio) * (1 - 2 * poisson_ratio));
  const double mu = young_modulus_pa / (2 * (1 + poisson_ratio));
  Solid solid;
  solid.density_kg_m3 = density_kg_m3;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) solid.elasticity_pa[6 * r + c] = lambda + (r == c ? 2 * mu : 0.0);
    solid.elasticity_pa[7 * (3 + r)] = mu;
  }
  return solid;
}

double predict_cents(const ErrorBars::Parts& parts, Kind kind, double edge_ratio) {
  constexpr double kInterpolation = 2.0, kGeometry = 1.5, kNoise = 0.15, kShared = 0.7, kMostOfEnergy = 0.99;
  const double second = edge_ratio * edge_ratio, fourth = second * second;
  const double share = std::min(parts.interpolation * (kind == Kind::kT4 ? second : fourth), kMostOfEnergy);
  const double interpolation = share / (1.0 - share);  // of the true lambda, where `share` is of the computed one
  const double lumping = std::abs(parts.lumping) * second;
  const double geometry =
      (kGeometry * std::abs(parts.geometry) + kNoise * parts.geometry_noise) * (kind == Kind::kT10Curved ? fourth : second);
  // Interpolation raises lambda and lumping lowers it: what they share is not counted twice, but not trusted to cancel either.
  const double both = kInterpolation * std::abs(interpolation - lumping) + kShared * std::min(interpolation, lumping);
  return 600.0 * std::log2(1.0 + both + geometry);
}

}  // namespace carillon::estimate
