// Predicted memory of a run.
#pragma once

#include "precompute/job/cost/problem_size.hpp"

namespace carillon::cost {

/// Memory of a single-rank solve [byte]. predict_parts() estimates all parts; measured or analysed values replace them.
struct MemoryParts {
  double program = 0;      // before the mesh
  double read_peak = 0;    // until K and M are assembled, including the program
  double assembled = 0;    // mesh, K and M, including the program
  double copies_peak = 0;  // node-block copies of K and M, during construction
  double copies = 0;       // the same afterwards
  double factor_peak = 0;  // one factorisation with update matrices
  double factor = 0;       // L alone
};
MemoryParts predict_parts(const ProblemSize& size);

/// K and M as PETSc stores them [byte].
double calc_matrix_bytes(const ProblemSize& size);

/// Peak of all ranks together [byte]. size.modes: upper bound.
double calc_peak_bytes(const MemoryParts& parts, const ProblemSize& size, int ranks);

/// The same before anything is known but the size [byte].
double predict_bytes(const ProblemSize& size, int ranks);

}  // namespace carillon::cost
