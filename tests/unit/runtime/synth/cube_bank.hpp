// Bank of a cube of 10 cm with invented modes, without a solver.
#pragma once

#include <cmath>
#include <numbers>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::testing {

struct InventedMode {
  double freq_hz = 0.0;
  double decay_per_s = 0.0;
  double gain = 1.0;
  Vec3 direction{0.0, 0.0, 1.0};  // phi at every vertex [kg^-1/2], times 1 + slope * (vertex number)
  double slope = 0.0;
};

/// Cube of side 0.1 m about the origin, corners numbered by the bits x, y, z; mass by `density`. Modes ascending in frequency.
inline bank::Bank make_cube_bank(const std::vector<InventedMode>& modes, double density = 1000.0) {
  bank::Bank bank;
  for (int corner = 0; corner < 8; ++corner) {
    bank.vertices_m.push_back({corner & 1 ? 0.05 : -0.05, corner & 2 ? 0.05 : -0.05, corner & 4 ? 0.05 : -0.05});
  }
  bank.triangles = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                    {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  std::vector<double> shapes(8 * modes.size() * 3);
  bank.shape.resize(shapes.size());
  for (std::size_t m = 0; m < modes.size(); ++m) {
    const double omega = 2.0 * std::numbers::pi * modes[m].freq_hz;
    bank.eigenvalue_rad2_s2.push_back(omega * omega);
    bank.decay_per_s.push_back(modes[m].decay_per_s);
    bank.residual.push_back(1e-10);
    bank.radiation_gain.push_back(modes[m].gain);
    double largest = 0.0;
    for (int corner = 0; corner < 8; ++corner) {
      for (int k = 0; k < 3; ++k) {
        const double value = modes[m].direction[k] * (1.0 + modes[m].slope * corner);
        shapes[(corner * modes.size() + m) * 3 + k] = value;
        largest = std::max(largest, std::abs(value));
      }
    }
    bank.shape_scale.push_back(largest / 32767.0);
    for (int corner = 0; corner < 8; ++corner) {
      for (int k = 0; k < 3; ++k) {
        const std::size_t i = (corner * modes.size() + m) * 3 + k;
        bank.shape[i] = static_cast<std::int16_t>(largest > 0.0 ? std::lround(shapes[i] / bank.shape_scale[m]) : 0);
      }
    }
  }
  const double mass = density * 1e-3;
  const double moment = mass * 0.01 / 6.0;
  bank.rigid = {.mass_kg = mass, .centre_m = {0, 0, 0}, .inertia_kg_m2 = {moment, 0, 0, 0, moment, 0, 0, 0, moment}, .volume_m3 = 1e-3};
  bank.material = {.young_modulus_pa = 5e9,
                   .poisson_ratio = 0.3,
                   .density_kg_m3 = density,
                   .alpha1_s = 0.0,
                   .alpha2_per_s = modes.empty() ? 0.0 : 2.0 * modes[0].decay_per_s};
  bank.counts = {.nodes = 8, .tets = 5, .components = 1, .rigid_modes = 6};
  bank.element = "T4";
  bank.mass = "consistent";
  bank.provenance = "{}";
  return bank;
}

/// 100 Hz to 23 kHz, evenly spaced in pitch.
inline std::vector<InventedMode> make_many_modes(int count) {
  std::vector<InventedMode> modes;
  for (int m = 0; m < count; ++m) {
    const double freq = 100.0 * std::pow(230.0, (m + 0.5) / count);
    modes.push_back({freq, 2.0 + 1e-6 * freq * freq, 1e-2, {0.3, -0.2, 1.0}, 0.1});
  }
  return modes;
}

}  // namespace carillon::testing
