// From the modes found to the modes returned.
#pragma once

#include <vector>

#include "precompute/eigen/band.hpp"
#include "precompute/eigen/inertia.hpp"
#include "precompute/eigen/types.hpp"

namespace carillon::eigen {

/// modes.lambda (scaled, ascending) and modes.shapes (M-orthonormal) are refined within the tolerance, degenerate ones get their canonical
/// basis, all are measured and oriented; what is beyond max_modes goes. Afterwards they are in the units of K and M, and residual,
/// above_tolerance_count, orthonormality_error and proof.clusters are set. counter: its factor serves the refinement and is freed; null:
/// none was made. others: lambda (scaled) of modes found and not taken, for the margins of the counts. Collective. Throws SolveError where
/// a residual stays above the tolerance and above what rounding explains.
void finish_modes(const BandProblem& body, InertiaCounter* counter, const std::vector<double>& others, Modes& modes);

}  // namespace carillon::eigen
