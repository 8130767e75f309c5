// Modes coupled by the air.
#pragma once

#include <complex>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "precompute/air/equations.hpp"

namespace carillon::air {

/// A mode in air as a sum of in-vacuo motions of unit modal mass. With M the mass matrix of the air: part^T (1 + M) part = 1.
struct Mixture {
  std::vector<std::int32_t> motions;  // ascending
  std::vector<double> parts;
  double wave_number_1_m = 0.0;  // k^2 = part^T diag(k_i^2) part
  double added_mass = 0.0;       // part^T M part / part^T part

  bool is_empty() const { return motions.empty(); }
};

/// Modes of diag(k_i^2) q = k^2 (1 + M) q at the wave numbers `wave_number_1_m` of the n motions. Modes in air and motions are paired by
/// their largest parts, so weak coupling keeps mode numbers. Motions below `kept` of a mode's largest part are omitted. `mass`: (n, n),
/// symmetric. Throws InputError if 1 + M is not positive definite.
std::vector<Mixture> couple_modes(std::span<const double> wave_number_1_m, std::span<const double> mass, double kept);

/// Mode nearest to `before` for another mass matrix (n, n) of its n motions, whose wave numbers are given (0: rigid). Modes whose k^2 agree
/// to 1e-4 keep the orientation of `before`. Throws InputError if 1 + M is not positive definite.
Mixture follow_mode(std::span<const double> wave_number_1_m, std::span<const double> mass, const Mixture& before);

/// (sides, n) surface integrals of the pressure (N, sides) of each side times the velocity of each of the n motions.
std::vector<std::complex<double>> calc_reaction_rows(const BoundaryEquations& equations, std::span<const std::complex<float>> pressure,
                                                     std::size_t sides);

}  // namespace carillon::air
