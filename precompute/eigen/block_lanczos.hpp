// Block Lanczos with shift and invert.
#pragma once

#include <cstdint>
#include <functional>

#include "precompute/eigen/inner_product.hpp"
#include "precompute/eigen/lanczos_basis.hpp"
#include "precompute/eigen/lanczos_checkpoint.hpp"
#include "precompute/eigen/locked_modes.hpp"
#include "precompute/eigen/orthogonaliser.hpp"
#include "precompute/eigen/ritz.hpp"
#include "precompute/eigen/shift_invert.hpp"

namespace carillon::eigen {

/// Data of an iteration; everything must outlive it.
struct LanczosProblem {
  ShiftInvert& inverse;
  InnerProduct& inner;
  LanczosBasis& basis;  // its first columns hold the starting block
  const LockedModes& locked;
  PetscInt n = 0;          // global rows
  PetscInt first_row = 0;  // first row of this rank
};

/// Keeps the Krylov relation of its basis between calls, and the basis semi-orthogonal (orthogonaliser.hpp). Every member except get_...()
/// is collective.
class BlockLanczos {
 public:
  enum class End { kStopped, kExhausted, kCheckpointed };
  /// Called after a Ritz step with the steps so far; true ends the iteration.
  using Monitor = std::function<bool(const RitzPairs&, const RitzSelection&, int steps)>;

  /// max_steps: maximum number of blocks. checkpoint: may be null.
  BlockLanczos(const LanczosProblem& problem, RitzGoal goal, int max_steps, LanczosCheckpoint* checkpoint);

  /// Runs until the monitor returns true, the space is exhausted, or the checkpoint stops it. After kStopped the basis holds
  /// get_converged() Ritz vectors, M-orthonormal, in the order of the selection.
  End run(const Monitor& monitor);
  std::int64_t get_converged() const { return converged_; }

  /// Parts of run(). start(): from the starting block; false if nothing of it is left. step(): adds a block behind the basis; false if the
  /// space is exhausted. restart(): keeps the best Ritz vectors.
  bool start();
  bool step();
  void restart(RitzPairs& pairs, const RitzSelection& selection);

 private:
  void invert(int to);
  bool resume();
  bool is_orthonormal(int first, int width);
  bool save_if_requested();
  void plan_check(const RitzSelection& selection);
  void finish(RitzPairs& pairs, const RitzSelection& selection);
  la::Matrix calc_purified(const RitzPairs& pairs, const RitzSelection& selection, int count) const;
  void clear_nearest(const RitzPairs& pairs, const RitzSelection& selection, int count);
  void clear_locked(int count);

  ShiftInvert& inverse_;
  InnerProduct& inner_;
  LanczosBasis& basis_;
  const LockedModes& locked_;
  RitzGoal goal_;
  int max_steps_;
  LanczosCheckpoint* checkpoint_;
  Orthogonaliser orthogonaliser_;
  int steps_ = 0;
  int next_check_ = 0;  // size of the basis at the next Ritz step
  int last_size_ = 0;   // size at the last one
  std::int64_t last_converged_ = 0;
  std::int64_t converged_ = 0;
};

}  // namespace carillon::eigen
