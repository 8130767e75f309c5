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
  constexpr double kMaxOfEnergy = 0.99, kGeometry = 1.5, kNoise = 0.15, kT10 = 3.5, kT10Lumped = 4.5;
  const double second = edge_ratio * edge_ratio, fourth = second * second;
  const double interpolation = parts.interpolation * (kind == Kind::kT4 ? second : fourth), lumping = std::abs(parts.lumping) * second;
  // A share of the computed lambda as a share of the true one, which is smaller, times a safety factor.
  const auto enlarge = [&](double factor, double share) {
    const double s = std::clamp(share, 0.0, kMaxOfEnergy);
    return factor * s / (1.0 - s);
  };
  // Interpolation raises lambda and a lumped mass lowers it. Where both matter they are trusted to cancel within limits only.
  double mesh = enlarge(kind == Kind::kT4 ? 2.0 : kT10, interpolation);
  if (lumping > 0.0 && kind == Kind::kT4)
    mesh = enlarge(2.0, std::abs(interpolation - lumping)) + 0.4 * std::min(interpolation, lumping);
  else if (lumping > 0.0)  // how far up, and how far down
    mesh = std::max(enlarge(kT10Lumped, interpolation) - lumping, 1.75 * lumping - 0.65 * interpolation);
  const double geometry =
      (kGeometry * std::abs(parts.geometry) + kNoise * parts.geometry_noise) * (kind == Kind::kT10Curved ? fourth : second);
  const double doubt = kGeometry * std::abs(parts.doubt) + kNoise * parts.doubt_noise;
  return 600.0 * std::log2(1.0 + mesh + geometry + doubt);
}

}  // namespace carillon::estimate
