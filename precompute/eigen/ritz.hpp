// The Rayleigh-Ritz step of a Lanczos iteration: what its basis says of the eigenvalues.
#pragma once

#include <mpi.h>

#include <cstdint>
#include <functional>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/eigen/lanczos_basis.hpp"
#include "precompute/la/lapack.hpp"

namespace carillon::eigen {

/// Keeps T s_i = theta_i s_i with ||s_i|| = 1 and residual_i = ||R s_i||, R times the last block row of s_i: the norm of A^-1 M x - theta x
/// of the Ritz vector x = V s. Every number but the vectors has the same bits on every rank.
struct RitzPairs {
  la::Vector theta;              // (size), ascending
  la::Matrix vectors;            // (size, size), columns s_i; on other ranks than the first only after share_vectors()
  std::vector<double> residual;  // (size)
};

/// Of the basis with its last block complete. One eigenproblem of T, on the first rank. Collective.
RitzPairs calc_ritz_pairs(const comm::Communicator& comm, const LanczosBasis& basis);
/// Collective.
void share_vectors(const comm::Communicator& comm, RitzPairs& pairs);

/// What an iteration is to find.
struct RitzGoal {
  bool is_interval = false;  // all eigenvalues lambda of [low, high]; else the `wanted` ones that come first
  double low = 0;
  double high = 0;
  std::int64_t wanted = 0;     // their number,
  bool is_count_known = true;  // as is known, or guessed
  double sigma = 0;
  double tolerance = 0;  // of error()
  /// The error of a Ritz value from its residual: the convergence test.
  std::function<double(double theta, double residual)> error;
  /// From theta to lambda.
  std::function<double(double theta)> to_lambda;
  /// Whether eigenvalue a is wanted before b; ignored with an interval.
  std::function<bool(double a, double b)> comes_first;
};

/// Keeps the pairs in the order in which they are wanted, the converged ones first.
struct RitzSelection {
  std::vector<double> error;   // (size) of each pair; converged: within the tolerance
  std::vector<int> order;      // (size)
  std::int64_t converged = 0;  // leading ones of order
  bool is_complete = false;    // all that is wanted has converged, as far as the iteration shows
};

RitzSelection select(const RitzPairs& pairs, const RitzGoal& goal);

/// The first `count` of the selection as columns, (size, count).
la::Matrix pick_vectors(const RitzPairs& pairs, const RitzSelection& selection, int count);

}  // namespace carillon::eigen
