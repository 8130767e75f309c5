// The vibration modes of a distributed elastic body: all eigenpairs of K phi = lambda M phi in a band of frequencies, complete by count.
#pragma once

#include "precompute/eigen/types.hpp"

namespace carillon::eigen {

/// Solves K phi = lambda M phi for all modes with low_hz <= f <= high_hz, f = sqrt(lambda) / (2 pi), ascending. Collective on K's
/// communicator.
///
/// A band without a mode is an answer (empty lambda). K and M are not changed. Equations: docs/equations.md, eigenproblem.
/// Throws, on all ranks alike: InputError when the options or the layout are unusable; SolveError when a factorisation breaks down or fewer
/// modes converge than the band holds by the inertia of K - sigma M, or a residual stays above tolerance and rounding; SystemError when
/// memory runs out; Stopped when the checkpoint asked to stop. Dense solves are not saved, other methods than block Lanczos only between
/// their runs.
Modes solve_modes(const Problem& problem, const Options& options);

}  // namespace carillon::eigen
