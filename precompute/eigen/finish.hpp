// Post-processing of the modes found.
#pragma once

#include <vector>

#include "precompute/eigen/band.hpp"
#include "precompute/eigen/inertia.hpp"
#include "precompute/eigen/types.hpp"

namespace carillon::eigen {

/// Refines modes.lambda (scaled, ascending) and modes.shapes (M-orthonormal) to the tolerance, gives degenerate modes their canonical
/// basis, measures and orients all modes, and drops those beyond max_modes. Afterwards they are in the units of K and M, and residual,
/// above_tolerance_count, orthonormality_error and proof.clusters are set. counter: its factor serves the refinement and is freed; null if
/// there is none. others: lambda (scaled) of modes found but not wanted, for the margins of the counts. Collective. Throws SolveError if a
/// residual stays above the tolerance and above rounding.
void finish_modes(const BandProblem& body, InertiaCounter* counter, const std::vector<double>& others, Modes& modes);

}  // namespace carillon::eigen
