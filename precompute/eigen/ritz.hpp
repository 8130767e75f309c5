// Rayleigh-Ritz step of block Lanczos.
#pragma once

#include <mpi.h>

#include <cstdint>
#include <functional>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/eigen/lanczos_basis.hpp"
#include "precompute/la/lapack.hpp"

namespace carillon::eigen {

/// Eigenpairs T s_i = theta_i s_i, ||s_i|| = 1, and residual_i = ||R s_i||, with R applied to the last block row of s_i: the norm of A^-1 M
/// x - theta x of the Ritz vector x = V s_i. theta and residual have the same bits on all ranks.
struct RitzPairs {
  la::Vector theta;              // (size), ascending
  la::Matrix vectors;            // (size, size), columns s_i; on ranks other than 0 valid only after share_vectors()
  std::vector<double> residual;  // (size)
};

/// Requires set_diagonal() and set_coupling() for the last block of the basis. Rank 0 solves the eigenproblem of T. Collective.
RitzPairs calc_ritz_pairs(const comm::Communicator& comm, const LanczosBasis& basis);
/// Collective.
void share_vectors(const comm::Communicator& comm, RitzPairs& pairs);

/// Convergence goal of an iteration.
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

/// Pairs in the order in which they are wanted, converged ones first.
struct RitzSelection {
  std::vector<double> error;   // (size) of each pair; converged if within the tolerance
  std::vector<int> order;      // (size)
  std::int64_t converged = 0;  // number of leading entries of order
  bool is_complete = false;    // all wanted pairs have converged, as far as the iteration shows
};

RitzSelection select(const RitzPairs& pairs, const RitzGoal& goal);

/// The first `count` selected eigenvectors of T as columns, (size, count).
la::Matrix pick_vectors(const RitzPairs& pairs, const RitzSelection& selection, int count);

}  // namespace carillon::eigen
