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
  double tolerance = 1e-8;                     // of the relative residual
  ShiftedFactor* at_hand = nullptr;            // a factor with values, of any shift in or near the band, tried first; may be null
  std::function<ShiftedFactor&()> get_factor;  // L D L^T for any shift; called only if a mode needs it
  std::function<bool()>
      switch_to_pivoting_solver;  // get_factor then returns a factor with more pivoting; false if there is none. May be empty
};

struct RefineCost {
  std::int64_t factorisations = 0;
  std::int64_t solves = 0;
};

/// Makes the modes M-orthonormal, measures them, and improves those whose residual is above the tolerance until none is left, or the
/// remaining ones are explained by rounding (errors.floor, checked after the first pass), or after six passes. lambda becomes the Rayleigh
/// quotients, ascending; errors is the last measurement. The caller judges modes that still fail (is_accepted). lambda: (modes) > 0,
/// roughly ascending; shapes: (3n, modes) dense. Collective. Throws SolveError if K - sigma M is singular at all shifts tried, or the modes
/// are linearly dependent.
RefineCost refine_modes(const RefineRequest& request, std::vector<double>& lambda, Mat shapes, ModeErrors& errors);

/// Measures modes whose residual is above the tolerance again through the inverse, which does not amplify the rounding of their entries by
/// the stiffness of fast motions: with d = (K - sigma M)^-1 (K phi - lambda M phi) and sigma below lambda, errors.residual becomes ||d||_M
/// (lambda - sigma) / lambda if smaller, and errors.floor at most this. Like the residual, it bounds the distance from lambda to an
/// eigenvalue, relative to lambda. Modes still above are corrected by d, at most three times. shapes: M-orthonormal before and after.
/// Collective. Throws as refine_modes does.
RefineCost bound_error_by_inverse_residual(const RefineRequest& request, std::vector<double>& lambda, Mat shapes, ModeErrors& errors);

/// True if the residual of mode j is within the tolerance or within rounding.
bool is_accepted(const ModeErrors& errors, std::size_t j, double tolerance);

}  // namespace carillon::eigen
