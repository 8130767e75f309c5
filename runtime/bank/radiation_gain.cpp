// Method: one omnidirectional gain per mode from the unsigned volume velocity of the surface triangles, as for a pulsating sphere of the
//   same area.
// Source: OSG02 section 3.4 (one gain per mode); Pierce 1981, Acoustics, section 4.1 (pulsating sphere).
// Deviations: OSG02 sums the signed normal displacement, which vanishes for bending modes of symmetric bodies; here absolute values per
//   triangle are summed. The sign is dropped after the integral over a triangle: tangential motion of a curved surface contributes with
//   both signs to a flat triangle, which cancel there. The factor 1 / sqrt(1 + (k a)^2) bounds the gain at high frequencies.
#include "runtime/bank/radiation_gain.hpp"

#include <cmath>
#include <numbers>

#include "runtime/bank/surface.hpp"

namespace carillon::bank {

double calc_radiation_gain(double omega_rad_s, double flow, double area_m2) {
  const double ka = omega_rad_s / kSoundSpeedMs * std::sqrt(area_m2 / (4 * std::numbers::pi));
  return kAirDensityKgM3 * omega_rad_s / (4 * std::numbers::pi * std::sqrt(1 + ka * ka)) * flow;
}

void set_radiation_gains(Bank& bank, std::span<const double> shapes) {
  const std::size_t modes = bank.mode_count();
  std::vector<double> flow(modes, 0.0);
  double twice_area = 0.0;
  for (const Triangle& triangle : find_outer_triangles(bank.vertices_m, bank.triangles)) {
    const Vec3 normal = calc_normal(bank.vertices_m, triangle);
    twice_area += calc_length(normal);
    const double* rows[3];
    for (int k = 0; k < 3; ++k) rows[k] = &shapes[static_cast<std::size_t>(triangle[k]) * modes * 3];
    for (std::size_t m = 0; m < modes; ++m) {
      double through = 0.0;
      for (std::size_t c = 0; c < 3; ++c) through += normal[c] * (rows[0][3 * m + c] + rows[1][3 * m + c] + rows[2][3 * m + c]);
      flow[m] += std::abs(through) / 6.0;
    }
  }
  bank.radiation_gain.resize(modes);
  for (std::size_t m = 0; m < modes; ++m)
    bank.radiation_gain[m] = calc_radiation_gain(std::sqrt(bank.eigenvalue_rad2_s2[m]), flow[m], 0.5 * twice_area);
}

double calc_outer_area_m2(const Bank& bank) {
  double twice = 0.0;
  for (const Triangle& triangle : find_outer_triangles(bank.vertices_m, bank.triangles)) {
    const Vec3 normal = calc_normal(bank.vertices_m, triangle);
    twice += calc_length(normal);
  }
  return 0.5 * twice;
}

}  // namespace carillon::bank
