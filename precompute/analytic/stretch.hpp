// Rows of the large-motion energy of bodies with known shapes (docs/equations.md E12).
#pragma once

#include <cmath>
#include <cstddef>
#include <span>

#include "precompute/la/lapack.hpp"
#include "runtime/bank/quartic_energy.hpp"

namespace carillon::analytic {

/// Appends the row A_r, symmetric (N, N) [J^1/2 m^-2 kg^-1]. Rounding off the diagonal is set to 0, since the player stores diagonal rows
/// separately.
inline void append_row(const la::Matrix& a, bank::QuarticEnergy& energy) {
  constexpr double kRounding = 1e-12;
  for (Eigen::Index j = 0; j < a.cols(); ++j)
    for (Eigen::Index i = 0; i <= j; ++i) {
      const bool is_rounding = std::abs(a(i, j)) <= kRounding * std::sqrt(std::abs(a(i, i) * a(j, j)));
      energy.rows.push_back(i != j && is_rounding ? 0.0F : static_cast<float>(a(i, j)));
    }
}

/// Appends a diagonal row, (N).
inline void append_diagonal_row(std::span<const double> a, bank::QuarticEnergy& energy) {
  for (std::size_t j = 0; j < a.size(); ++j) {
    energy.rows.insert(energy.rows.end(), j, 0.0F);
    energy.rows.push_back(static_cast<float>(a[j]));
  }
}

}  // namespace carillon::analytic
