// Rows of the large-motion energy of bodies with known shapes (docs/equations.md E12).
#pragma once

#include <span>

#include "precompute/la/lapack.hpp"
#include "runtime/bank/quartic_energy.hpp"

namespace carillon::analytic {

/// Appends the row A_r, symmetric (N, N) [J^1/2 m^-2 kg^-1]. Rounding off the diagonal is set to 0, since the player stores diagonal rows
/// separately.
void append_row(const la::Matrix& a, bank::QuarticEnergy& energy);
/// Appends a diagonal row, (N).
void append_diagonal_row(std::span<const double> a, bank::QuarticEnergy& energy);

}  // namespace carillon::analytic
