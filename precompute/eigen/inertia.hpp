// Eigenvalue counts and the factorisation that provides them.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/eigen/shifted_factor.hpp"
#include "precompute/eigen/types.hpp"
#include "precompute/petsc/handle.hpp"

namespace carillon::eigen {

/// Number of eigenvalues below lambda (scaled).
struct Inertia {
  double lambda = 0;
  std::int64_t below = 0;
};

/// Shift of a count: exactly the given one, or, if rounding makes it unusable so near zero, the lowest usable one above.
enum class ShiftRule { kExact, kMayMoveUp };

/// Factorisation of K - sigma M at the last shift, by the solver of the options, and all counts taken.
class InertiaCounter {
 public:
  /// Problem, options, rigid modes (M-orthonormal), seconds and statistics must outlive it. to_hz: scaled lambda to Hz, for messages.
  InertiaCounter(const la::Pencil& pencil, const Problem& problem, const Options& options, const std::vector<petsc::VecHandle>& rigid,
                 Seconds& seconds, FactorStatistics& statistics, std::function<double(double)> to_hz);

  /// Factorises at lambda, or up to `reach` (relative) above if lambda is an eigenvalue, and counts. Near zero, rigid modes count as below
  /// lambda regardless of rounding of K. Throws SolveError if K - sigma M is singular at all shifts tried, SystemError if memory does not
  /// suffice. Collective.
  Inertia count_below(double lambda, double reach = 1e-6, ShiftRule rule = ShiftRule::kExact);
  const std::vector<Inertia>& counts() const { return counts_; }
  /// Adds a count taken before, by another run.
  void restore(const Inertia& count) { counts_.push_back(count); }
  /// Removes counts taken too near an eigenvalue.
  void forget(double lambda);

  /// The factor without values: its fill, flops and memory. Collective.
  const ShiftedFactor& analyse();
  /// The factor of the last count; only analysed if there was none, or it was released. Collective.
  ShiftedFactor& get_factor();
  /// The factor of the last count; null if it has no values.
  ShiftedFactor* current_factor() { return is_current_ ? factor_.get() : nullptr; }
  /// The factor at sigma, where a count was taken before; factorises again if it is at another shift. Throws as count_below() does.
  /// Collective.
  ShiftedFactor& factor_at(double sigma);
  /// Switches to a solver that pivots across fronts: slower, and stable where ours is not. False if already switched, or forbidden by the
  /// options. Frees the factor. Collective.
  bool switch_to_mumps();
  /// Frees the factor; the next count makes a new one. Collective.
  void release() {
    factor_.reset();
    is_current_ = false;
  }

  /// Takes over the state of a previous run.
  void resume(bool uses_mumps, double worst_backward_error);
  bool uses_mumps() const { return uses_mumps_; }
  double get_worst_backward_error() const { return worst_backward_error_; }

 private:
  void make_factor();
  bool is_refused(double sigma) const;
  bool try_factorise(double sigma);
  bool try_around(double lambda, double reach);
  std::int64_t count_negative();

  const la::Pencil pencil_;
  const Problem& problem_;
  const Options& options_;
  const std::vector<petsc::VecHandle>& rigid_;
  Seconds& seconds_;
  FactorStatistics& statistics_;
  std::function<double(double)> to_hz_;
  const comm::Communicator comm_;
  double rounding_ = 0;  // of an eigenvalue, from a typical entry of K
  bool uses_mumps_ = false;
  std::unique_ptr<ShiftedFactor> factor_;
  bool is_current_ = false;  // factor_ holds the values at sigma_
  double sigma_ = 0;
  std::vector<Inertia> counts_;
  double worst_backward_error_ = 0;
};

}  // namespace carillon::eigen
