// Method: Solids: N(f) = V 4 pi/3 (1/cL^3 + 2/cT^3) f^3 + S pi/4 (2 cT^4 - 3 cT^2 cL^2 + 3 cL^4) / (cT^2 cL^2 (cL^2 - cT^2)) f^2, free
// surface. Thin walls of thickness h = 2 V / S: bending, N(f) = A/2 sqrt(12 (1 - nu^2)) f / (cE h), c_E = sqrt(E / rho), and in-plane
// waves, N(f) = A pi (1/cP^2 + 1/cT^2) f^2, A = S / 2. The larger of the two laws is used: the first lacks bending, the second thickness.
// Anisotropic solids by Voigt's averages; bodies of several materials by shares of the volume.
// Source: Dupuis, Mazo, Onsager, Surface specific heat of an isotropic solid at low temperatures, J. Chem. Phys. 33, 1960 (solids);
// Courant, Hilbert, Methods of mathematical physics I, 1953, section VI.4 (plates).
#include "precompute/job/cost/modes.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <numeric>

#include "precompute/job/cost/calibration.hpp"

namespace carillon::cost {
namespace {

struct Speeds {
  double longitudinal = 0;
  double shear = 0;
  double plate = 0;    // in-plane, thin wall
  double bending = 0;  // sqrt(E / (rho (1 - nu^2)))
};

Speeds calc_speeds(const material::Material& material) {
  const material::Elasticity c = material.calc_elasticity_pa();
  const double normal = c[0] + c[7] + c[14];
  const double coupled = c[1] + c[2] + c[8];
  const double bulk = (normal + 2 * coupled) / 9;
  const double mu = (normal - coupled + 3 * (c[21] + c[28] + c[35])) / 15;
  const double nu = (3 * bulk - 2 * mu) / (2 * (3 * bulk + mu));
  const double young = 2 * mu * (1 + nu);
  const double rho = material.density_kg_m3;
  const double plate = std::sqrt(young / (rho * (1 - nu * nu)));
  return {std::sqrt((bulk + 4 * mu / 3) / rho), std::sqrt(mu / rho), plate, plate};
}

double count_in_solid(const Speeds& c, double volume, double area, double f) {
  const double l2 = c.longitudinal * c.longitudinal;
  const double t2 = c.shear * c.shear;
  const double surface = (2 * t2 * t2 - 3 * t2 * l2 + 3 * l2 * l2) / (t2 * l2 * (l2 - t2));
  return volume * 4 * std::numbers::pi / 3 * (1 / (l2 * c.longitudinal) + 2 / (t2 * c.shear)) * f * f * f +
         area * std::numbers::pi / 4 * surface * f * f;
}

double count_in_wall(const Speeds& c, double volume, double area, double f) {
  const double thickness = 2 * volume / area;
  return area / 2 *
         (std::sqrt(3.0) * f / (c.bending * thickness) + std::numbers::pi * (1 / (c.plate * c.plate) + 1 / (c.shear * c.shear)) * f * f);
}

}  // namespace

ModeEstimate estimate_modes(const std::vector<material::Material>& materials, const std::vector<double>& volume_m3, double area_m2,
                            double low_hz, double high_hz) {
  ModeEstimate estimate;
  const double all = std::accumulate(volume_m3.begin(), volume_m3.end(), 0.0);
  estimate.slenderness = std::sqrt(area_m2) * area_m2 / (2 * all);
  for (std::size_t i = 0; i < materials.size(); ++i) {
    const Speeds c = calc_speeds(materials[i]);
    const double area = area_m2 * volume_m3[i] / all;
    const auto count = [&](double f) {
      return std::max(count_in_solid(c, volume_m3[i], area, f), count_in_wall(c, volume_m3[i], area, f));
    };
    estimate.count += std::max(count(high_hz) - count(low_hz), 0.0);
    estimate.is_thin = estimate.is_thin || (estimate.slenderness > kWallSlenderness && 2 * volume_m3[i] / area < c.shear / (2 * high_hz));
  }
  constexpr double kFew = 6;  // below this count the asymptotic law is unreliable
  estimate.low = std::max(estimate.count / (estimate.is_thin ? kCurvedFactor : kSolidFactor) - kFew, 0.0);
  estimate.high = estimate.count * (estimate.is_thin ? kThinFactor : kSolidFactor) + kFew;
  return estimate;
}

}  // namespace carillon::cost
