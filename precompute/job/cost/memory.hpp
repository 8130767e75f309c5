// Memory of a run, predicted from the size of its problem.
#pragma once

#include <cstdint>

#include "precompute/job/cost/problem_size.hpp"

namespace carillon::cost {

/// What one rank holds when it solves alone [byte]. predict_parts() estimates all; what has been measured or analysed replaces a part.
struct MemoryParts {
  double program = 0;      // before there is a mesh
  double read_peak = 0;    // until K and M are assembled, program included
  double assembled = 0;    // mesh, K and M, program included
  double copies_peak = 0;  // K and M by blocks of nodes while they are made,
  double copies = 0;       // and afterwards
  double factor_peak = 0;  // one factorisation with its update matrices,
  double factor = 0;       // and L alone
};
MemoryParts predict_parts(const ProblemSize& size);

/// K and M as PETSc stores them [byte].
double calc_matrix_bytes(const ProblemSize& size);

/// The peak of all ranks together [byte]. size.modes: as many as there can be.
double calc_peak_bytes(const MemoryParts& parts, const ProblemSize& size, int ranks);

/// The same of a body of which nothing was made yet [byte].
double predict_bytes(const ProblemSize& size, int ranks);

}  // namespace carillon::cost
