// Rayleigh-Ritz step of block Lanczos.
#pragma once

#include <mpi.h>

#include <cstdint>
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
  double low = 0;  // all eigenvalues lambda of [low, high] are wanted
  double high = 0;
  std::int64_t wanted = 0;     // their number
  bool is_count_known = true;  // wanted is exact; otherwise a guess
  double sigma = 0;
  double tolerance = 0;  // of calc_ritz_error()
};

inline double to_lambda(double sigma, double theta) { return 1 / theta + sigma; }

/// Error of a Ritz value theta from its residual: the convergence test of both methods. Relative to lambda = sigma + 1 / theta if that is
/// stricter than relative to theta, so that a mode near zero keeps its digits under a shift far above it; limited because rounding of the
/// operator prevents convergence beyond.
double calc_ritz_error(double sigma, double theta, double residual);

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
