// One shift-invert Krylov run.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "precompute/eigen/found_modes.hpp"
#include "precompute/eigen/lanczos_checkpoint.hpp"
#include "precompute/eigen/shifted_factor.hpp"
#include "precompute/eigen/types.hpp"
#include "precompute/la/node_matrix.hpp"
#include "precompute/la/pencil.hpp"

namespace carillon::eigen {

struct KrylovRequest {
  la::Pencil pencil;
  const la::NodeMatrix* mass_blocks = nullptr;  // M of the pencil, for products with many columns
  ShiftedFactor* factor = nullptr;              // factorised at sigma
  double sigma = 0;
  double low = 0;  // the interval searched
  double high = 0;
  PetscInt count = 0;                          // eigenvalues in it, without the locked ones
  bool is_count_known = true;                  // count is exact; otherwise a guess
  PetscInt nearest = 0;                        // eigenvalues nearest to sigma that include those of the interval (Krylov-Schur)
  Method method = Method::kAutomatic;          // block Lanczos unless kKrylovSchur
  double tolerance = 1e-10;                    // of the Ritz residual, relative to theta = 1 / (lambda - sigma) and to lambda
  double locked_above = 0;                     // stays M-orthogonal to the rigid modes and to modes found above this lambda
  const std::vector<Vec3>* nodes_m = nullptr;  // positions that determine the starting block
  int round = 0;                               // starting blocks of different rounds differ
  int max_steps = 0;                           // blocks; 0: by the size of the basis
  /// Pairs converged and right-hand sides solved in this run so far; may be empty.
  std::function<void(std::int64_t converged, std::int64_t solves)> progress;
  LanczosCheckpoint* checkpoint = nullptr;  // of block Lanczos; may be null
};

struct KrylovStatistics {
  std::int64_t solves = 0;
  double solve_seconds = 0;
  double solved_to = 0;  // no eigenvalue is missing from sigma to here, as far as the run shows; at most the end of the interval
};

/// Columns of the basis of block Lanczos, residuals included, for `wanted` eigenvalues with `locked` columns deflated: twice the modes and
/// eight blocks suffice at the bottom of a spectrum; more with neighbours on both sides, or for a guessed count.
std::int64_t calc_basis_size(std::int64_t wanted, std::int64_t locked, bool is_count_known);

/// Adds eigenpairs of K x = lambda M x in the interval to `found`. Pairs may be missing if they did not converge, or are copies of repeated
/// eigenvalues. Collective.
KrylovStatistics run_krylov(const KrylovRequest& request, FoundModes& found);

}  // namespace carillon::eigen
