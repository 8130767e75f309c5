// All eigenpairs of a small problem at once.
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

/// Solves K x = lambda M x completely with dense matrices on every rank. Collective; memory grows as n^2 on each rank, time as n^3.
/// Throws SolveError when M is not positive definite.
DensePairs solve_dense(const la::Pencil& pencil);

}  // namespace carillon::eigen
