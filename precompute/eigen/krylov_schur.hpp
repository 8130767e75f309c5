// Krylov-Schur of SLEPc.
#pragma once

#include "precompute/eigen/found_modes.hpp"
#include "precompute/eigen/krylov.hpp"
#include "precompute/eigen/locked_modes.hpp"

namespace carillon::eigen {

/// run_krylov() by the Krylov-Schur method, orthogonal to `locked`. Collective.
KrylovStatistics run_krylov_schur(const KrylovRequest& request, const LockedModes& locked, FoundModes& found);

}  // namespace carillon::eigen
