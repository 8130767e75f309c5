// Cubature points for the coupling of modes, and the nonnegative least squares that weigh them.
#pragma once

#include <cstddef>

#include "precompute/coupling/stresses.hpp"
#include "precompute/la/lapack.hpp"

namespace carillon::coupling {

/// Sparse x >= 0 with small |A x - b|: Lawson and Hanson's method, stopped at |A x - b| <= tolerance |b|, at `most` nonzero entries, or
/// without further improvement. Not collective.
la::Vector solve_nonnegative(const la::Matrix& a, const la::Vector& b, double tolerance, std::ptrdiff_t most);

/// P points: eta_r = sum over p of weight_p stress_rp . strain_p, as bank::QuarticEnergy has it for solids. Rank 0.
struct CouplingPoints {
  la::Matrix gradient;  // (9 P, N), row 9 p + 3 k + a
  la::Matrix stress;    // (6 P, R)
  la::Vector weight;    // (P)
  double error = 0;     // energy error on the tests: see calc_error()
};

/// Chooses integration points by nonnegative least squares on random motions, then fits the stress at the points. Adds points until `error`
/// is met, at most `most`; the result's error shows which. fields: with values. Collective; empty except on rank 0.
CouplingPoints choose_points(const CoupledBody& body, const mesh::LocalMesh& local, const StressFields& fields, double error,
                             std::ptrdiff_t most);

}  // namespace carillon::coupling
