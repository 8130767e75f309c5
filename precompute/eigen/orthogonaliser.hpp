// Projection and orthonormalisation of Lanczos blocks.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "precompute/eigen/inner_product.hpp"
#include "precompute/eigen/lanczos_basis.hpp"
#include "precompute/eigen/lanczos_checkpoint.hpp"
#include "precompute/eigen/locked_modes.hpp"
#include "precompute/eigen/orthogonality.hpp"

namespace carillon::eigen {

/// Turns the block W of the inner product into the next block of the basis. Keeps the basis semi-orthogonal, |V^T M V - 1| < 2e-7, and |L^T
/// M V| of the locked modes L below 1e-6.
class Orthogonaliser {
 public:
  /// All arguments must outlive it. theta: eigenvalues of the operator for the locked modes. n: global rows; first_row: first row of this
  /// rank. checkpoint may be null; the ranks' requests to it are summed with the projection coefficients.
  Orthogonaliser(InnerProduct& inner, LanczosBasis& basis, const LockedModes& locked, std::vector<double> theta, PetscInt n,
                 PetscInt first_row, LanczosCheckpoint* checkpoint);

  /// Projects the first block W against the locked modes and makes it M-orthonormal. Returns the number of columns left: fewer than the
  /// block if the space is exhausted. Collective.
  int start();
  /// Turns W = A^-1 Z, Z = M V_j, into V_next and sets the diagonal block of T and R such that A^-1 M V_j = V_{j-1} R_{j-1}^T + V_j alpha +
  /// V_next R. Columns of W beyond V_next are set to zero. Collective.
  void step();
  /// Discards the loss-of-orthogonality estimates after a restart.
  void reset();

  /// Requests of all ranks since clear_request().
  const CheckpointRequest& request() const { return request_; }
  void clear_request() { request_ = {}; }

  std::uint64_t get_random_columns() const { return random_columns_; }
  void set_random_columns(std::uint64_t count) { random_columns_ = count; }
  /// (locked) largest remaining entry of L^T M V per locked mode.
  const std::vector<double>& get_remaining() const { return deflation_.get_remaining(); }

 private:
  LanczosStep here() const { return {basis_.t(), basis_.size(), basis_.width(), basis_.previous()}; }
  int count() const { return basis_.size() == 0 ? basis_.block() : basis_.width(); }  // maximum columns of the next block
  PetscInt free_dimension() const { return n_ - locked_.count(); }
  la::Matrix calc_recurrence(const la::Matrix& alpha) const;
  void decide(const la::Matrix& alpha);
  la::Matrix project(la::Matrix* alpha);
  la::Matrix subtract_and_vote(const la::Product& product, int s_stride, std::span<const Columns> against, int count);
  std::vector<Columns> find_projected_out() const;
  bool confirm(const la::Matrix& r) const;
  la::Matrix reproject(const la::Matrix& before);
  la::Matrix orthonormalise();
  bool orthonormalise_by_cholesky(la::Matrix& r);
  la::Matrix orthonormalise_by_columns();
  double orthogonalise_column(int i, double* coefficients);
  bool fill_at_random(int i);

  InnerProduct& inner_;
  LanczosBasis& basis_;
  const LockedModes& locked_;
  PetscInt n_;
  PetscInt first_row_;
  LanczosCheckpoint* checkpoint_;
  CheckpointRequest request_;
  OrthogonalityEstimate estimate_;
  DeflationEstimate deflation_;
  bool is_skipped_ = false;  // this step skips the projection against the whole basis
  LockedRange projected_;    // locked modes projected out in this step
  std::uint64_t random_columns_ = 0;
};

}  // namespace carillon::eigen
