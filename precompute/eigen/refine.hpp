// Corrects modes whose residual is above the tolerance.
#pragma once

#include <petscmat.h>

#include <cstdint>
#include <functional>
#include <vector>

#include "precompute/eigen/check_modes.hpp"
#include "precompute/eigen/shifted_factor.hpp"

namespace carillon::eigen {

struct RefineRequest {
  const Operators* operators = nullptr;
  double tolerance = 1e-8;                          // of the relative residual
  ShiftedFactor* at_hand = nullptr;                 // a factor with numbers, of any shift in or near the band: tried first; may be null
  std::function<ShiftedFactor&()> get_factor;       // L D L^T of any shift; called only when a mode needs it
  std::function<bool()> switch_to_pivoting_solver;  // get_factor then gives one that pivots more; false when there is none. May be empty
};

struct RefineCost {
  std::int64_t factorisations = 0;
  std::int64_t solves = 0;
};

/// Makes the modes M-orthonormal, measures them, and improves those whose residual is above the tolerance until none is left, or what is
/// left after a first pass is explained by rounding (errors.floor), or six passes are over. lambda becomes the Rayleigh quotients,
/// ascending; errors is what was measured last. Modes that still fail are the caller's to judge: is_accepted. lambda: (modes) > 0, about
/// ascending; shapes: (3n, modes) dense. Collective. Throws SolveError when K - sigma M is singular wherever it is tried, or the modes are
/// linearly dependent.
RefineCost refine_modes(const RefineRequest& request, std::vector<double>& lambda, Mat shapes, ModeErrors& errors);

/// Measures the modes whose residual is above the tolerance once more, through the inverse, where the rounding of their entries is not
/// multiplied by the stiffness against fast motions: with d = (K - sigma M)^-1 (K phi - lambda M phi) and sigma below lambda,
/// errors.residual becomes ||d||_M (lambda - sigma) / lambda where that is less, and errors.floor no more than it. It bounds the distance
/// of lambda from an eigenvalue, relative to lambda, as the residual does. Modes that are still above are corrected by d, three times at
/// most. shapes: M-orthonormal, and so afterwards. Collective. Throws as refine_modes does.
RefineCost bound_error_by_inverse_residual(const RefineRequest& request, std::vector<double>& lambda, Mat shapes, ModeErrors& errors);

/// True if mode j is good: its residual is within the tolerance, or within what rounding explains.
bool is_accepted(const ModeErrors& errors, std::size_t j, double tolerance);

}  // namespace carillon::eigen
