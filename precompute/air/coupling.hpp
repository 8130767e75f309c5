// Modes that the air couples.
#pragma once

#include <complex>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "precompute/air/equations.hpp"

namespace carillon::air {

/// A mode in air as a sum of motions of the body without it, each of unit modal mass: with M the mass matrix of the air,
/// part^T (1 + M) part = 1.
struct Mixture {
  std::vector<std::int32_t> motions;  // ascending
  std::vector<double> parts;
  double wave_number_1_m = 0.0;  // k^2 = part^T diag(k_i^2) part
  double added_mass = 0.0;       // part^T M part / part^T part

  bool is_empty() const { return motions.empty(); }
};

/// The modes of diag(k_i^2) q = k^2 (1 + M) q, one for each of the n motions at `wave_number_1_m`: pairs of a mode in air and a motion are
/// made by their largest parts, so that weak coupling leaves each mode its number. Motions with less than `kept` of the largest part of a
/// mode are left out of its mixture. `mass`: (n, n), symmetric. Throws InputError where 1 + M is not positive definite.
std::vector<Mixture> couple_modes(std::span<const double> wave_number_1_m, std::span<const double> mass, double kept);

/// The mode nearest to `before`, for another mass (n, n) between its n motions, whose wave numbers are given (0: rigid). Modes whose
/// k^2 agree to 1e-4 stay as they were turned in `before`. Throws InputError where 1 + M is not positive definite.
Mixture follow_mode(std::span<const double> wave_number_1_m, std::span<const double> mass, const Mixture& before);

/// (sides, n) integrals over the surface of the pressure (N, sides) of each side times the velocity of each of the n motions.
std::vector<std::complex<double>> calc_reaction_rows(const BoundaryEquations& equations, std::span<const std::complex<float>> pressure,
                                                     std::size_t sides);

}  // namespace carillon::air
