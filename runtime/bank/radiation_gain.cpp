// Method: one omnidirectional gain per mode from the volume velocity of the surface, taken triangle by triangle without sign, as of a
//   pulsating sphere of the same area.
// Source: OSG02 section 3.4 (one gain per mode); Pierce 1981, Acoustics, section 4.1 (pulsating sphere).
// Deviations: OSG02 sums the signed normal displacement, which is zero for every bending mode of a symmetric body; here its absolute value
//   times area. The sign is dropped after the integral over a triangle, not inside it: a motion along a curved surface leaks through flat
//   triangles with both signs, which cancel within each. The factor 1 / sqrt(1 + (k a)^2) bounds the gain at high frequencies, where
//   OSG02's grows without end.
#include "runtime/bank/radiation_gain.hpp"

#include <cmath>
#include <numbers>

#include "runtime/bank/surface.hpp"

namespace carillon::bank {

double calc_radiation_gain(double omega_rad_s, double flow, double area_m2) {
  const double ka = omega_rad_s / kSoundSpeedMs * std::sqrt(area_m2 / (4 * std::numbers::pi));
  return kAirDensityKgM3 * omega_rad_s / (4 * std::numbers::pi * std::sqrt(1 + ka * ka)) * flow;
}

double calc_outer_area_m2(const Bank& bank) {
  double twice = 0.0;
  for (const Triangle& triangle : find_outer_triangles(bank.vertices_m, bank.triangles)) {
    const Vec3 normal = calc_normal(bank.vertices_m, triangle);
    twice += std::hypot(normal[0], normal[1], normal[2]);
  }
  return 0.5 * twice;
}

}  // namespace carillon::bank
