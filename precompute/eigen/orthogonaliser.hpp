// Projection and orthonormalisation of the blocks of a Lanczos basis.
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

/// Makes the block W of the inner product the next block of the basis. Keeps the basis semi-orthogonal, |V^T M V - 1| below 2e-7,
/// orthogonal to the fixed columns, and |L^T M V| of the locked modes below 1e-6.
class Orthogonaliser {
 public:
  /// All must outlive it. theta: the locked modes' eigenvalues of the operator. n: rows of all ranks; first_row: of this one. checkpoint
  /// may be null; what the ranks request of it is voted along with the sums of the projection.
  Orthogonaliser(InnerProduct& inner, LanczosBasis& basis, const LockedModes& locked, std::vector<double> theta, PetscInt n,
                 PetscInt first_row, LanczosCheckpoint* checkpoint);

  /// W, the first block, is projected against what is fixed and locked and made M-orthonormal. Returns how many columns are left: fewer
  /// when the space is exhausted. Collective.
  int start();
  /// W = A^-1 Z, Z = M V_j, becomes V_next; the basis gets the diagonal block of T and R with
  /// A^-1 M V_j = V_{j-1} R_{j-1}^T + V_j alpha + V_next R. Columns of W beyond V_next are zero. Collective.
  void step();
  /// The basis has been restarted, and what was estimated of it no longer holds.
  void reset();

  /// Of all ranks, since clear_request().
  const CheckpointRequest& request() const { return request_; }
  void clear_request() { request_ = {}; }

  std::uint64_t get_random_columns() const { return random_columns_; }
  void set_random_columns(std::uint64_t count) { random_columns_ = count; }
  /// (locked) the largest entries of L^T M V that remained.
  const std::vector<double>& get_remaining() const { return deflation_.get_remaining(); }

 private:
  LanczosStep here() const { return {basis_.t(), basis_.size(), basis_.width(), basis_.previous()}; }
  int count() const { return basis_.size() == 0 ? basis_.block() : basis_.width(); }  // columns of the next block at most
  PetscInt free_dimension() const { return n_ - basis_.fixed().count - locked_.count(); }
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
  bool is_skipped_ = false;  // the step did without the projection against the whole basis,
  LockedRange projected_;    // the locked modes that it projected out
  std::uint64_t random_columns_ = 0;
};

}  // namespace carillon::eigen
