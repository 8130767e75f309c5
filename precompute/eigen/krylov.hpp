// One shift-invert Krylov-Schur run.
#pragma once

#include <functional>
#include <vector>

#include "precompute/eigen/shifted_factor.hpp"
#include "precompute/petsc/handle.hpp"

namespace carillon::eigen {

/// Eigenpairs found so far: lambda unordered, vectors M-orthonormal.
struct Pairs {
  std::vector<double> lambda;
  std::vector<petsc::VecHandle> vectors;
};

struct KrylovRequest {
  Mat stiffness = nullptr;
  Mat mass = nullptr;
  ShiftedFactor* factor = nullptr;  // already factorised at sigma
  double sigma = 0;
  PetscInt wanted = 0;                                   // the eigenvalues nearest sigma, those of the deflated space not counted
  double tolerance = 1e-10;                              // of the Ritz residual, relative to theta = 1 / (lambda - sigma) and to lambda
  std::vector<Vec> deflated;                             // M-orthonormal, the run stays M-orthogonal to them
  std::function<void(std::int64_t converged)> progress;  // may be empty
};

struct KrylovResult {
  Pairs pairs;  // at least `wanted` if it converged; nearest sigma first
  std::int64_t solves = 0;
  double solve_seconds = 0;
};

/// Finds eigenpairs of K x = lambda M x nearest sigma. Fewer than wanted come back when the iteration stagnates. Collective.
KrylovResult run_krylov_schur(const KrylovRequest& request);

}  // namespace carillon::eigen
