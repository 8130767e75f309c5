// Vibration modes of a distributed elastic body: all eigenpairs of K phi = lambda M phi in a frequency band, complete by count.
#pragma once

#include "precompute/eigen/types.hpp"

namespace carillon::eigen {

/// Solves K phi = lambda M phi for all modes with low_hz <= f <= high_hz, f = sqrt(lambda) / (2 pi), ascending. Collective on the
/// communicator of K.
///
/// A band without modes is valid (empty lambda). K and M are not changed. Equations: docs/equations.md, eigenproblem. Throws, on all ranks
/// alike: InputError for invalid options or layout; SolveError if a factorisation breaks down, fewer modes converge than the band contains
/// by the inertia of K - sigma M, or a residual stays above tolerance and rounding; SystemError if memory runs out; Stopped on a stop
/// request of the checkpoint. Dense solves are not saved, Krylov-Schur only between its runs.
Modes solve_modes(const Problem& problem, const Options& options);

}  // namespace carillon::eigen
