// The bank of a free square steel plate, its modes by Ritz (tests/unit/runtime/physics/impact/free_plate.hpp).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "tests/unit/runtime/physics/impact/free_plate.hpp"
#include "tests/unit/runtime/physics/solids.hpp"

namespace carillon::physics::tests {

/// Surface of n x n cells a side; every vertex moves along z as the middle plane above or below it.
inline bank::Bank make_plate_bank(double side_m, double thickness_m, double highest_hz, int n, double decay_per_s) {
  bank::Bank bank = make_box({side_m, side_m, thickness_m}, {n, n, 1});
  bank.material = {impact::tests::kYoung, impact::tests::kPoisson, impact::tests::kDensity, 1e-7, 1.0};
  set_rigid_of_solid(bank);
  const impact::tests::FreePlate plate = impact::tests::make_free_plate(side_m, thickness_m, highest_hz);
  const std::size_t modes = plate.omega.size();
  std::vector<double> values(bank.vertices_m.size() * modes);
  std::vector<double> largest(modes, 0.0);
  for (std::size_t v = 0; v < bank.vertices_m.size(); ++v)
    for (std::size_t i = 0; i < modes; ++i) {
      const double phi = plate.calc_shape(i, 2.0 * bank.vertices_m[v][0] / side_m, 2.0 * bank.vertices_m[v][1] / side_m);
      values[v * modes + i] = phi;
      largest[i] = std::max(largest[i], std::abs(phi));
    }
  for (std::size_t i = 0; i < modes; ++i) {
    bank.eigenvalue_rad2_s2.push_back(plate.omega[i] * plate.omega[i]);
    bank.decay_per_s.push_back(decay_per_s);
    bank.residual.push_back(1e-10);
    bank.radiation_gain.push_back(1.0);
    bank.shape_scale.push_back(largest[i] / 32767.0);
  }
  bank.shape.reserve(values.size() * 3);
  for (std::size_t v = 0; v < bank.vertices_m.size(); ++v)
    for (std::size_t i = 0; i < modes; ++i)
      bank.shape.insert(bank.shape.end(), {0, 0, static_cast<std::int16_t>(std::lround(32767.0 * values[v * modes + i] / largest[i]))});
  return bank;
}

}  // namespace carillon::physics::tests
