// All eigenpairs of a small problem.
#pragma once

#include <petscmat.h>

#include <vector>

#include "precompute/la/pencil.hpp"
#include "precompute/petsc/handle.hpp"

namespace carillon::eigen {

struct DensePairs {
  std::vector<double> lambda;  // (n), ascending
  petsc::MatHandle vectors;    // (n, n) dense, M-orthonormal columns, the row distribution of K
};

/// Solves K x = lambda M x completely with dense matrices on every rank. Collective; memory per rank grows as n^2, time as n^3. Throws
/// SolveError if M is not positive definite.
DensePairs solve_dense(const la::Pencil& pencil);

}  // namespace carillon::eigen
