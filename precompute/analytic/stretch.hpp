// Rows of the energy of large motion of bodies whose shapes are known (docs/equations.md E12).
#pragma once

#include <span>

#include "precompute/la/lapack.hpp"
#include "runtime/bank/quartic_energy.hpp"

namespace carillon::analytic {

/// Appends the row A_r, symmetric (N, N) [J^1/2 m^-2 kg^-1]. What is rounding of the diagonal is 0: players keep diagonal rows apart.
void append_row(const la::Matrix& a, bank::QuarticEnergy& energy);
/// The same of a row without anything off its diagonal, (N).
void append_diagonal_row(std::span<const double> a, bank::QuarticEnergy& energy);

}  // namespace carillon::analytic
