// Counts of eigenvalues, and the factorisation they come from.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "precompute/eigen/shifted_factor.hpp"
#include "precompute/eigen/solve_modes.hpp"
#include "precompute/petsc/handle.hpp"

namespace carillon::eigen {

/// How many eigenvalues lie below lambda (scaled).
struct Inertia {
  double lambda = 0;
  std::int64_t below = 0;
};

/// Where a count is wanted: there; or, where rounding makes a shift so near zero worthless, at the least one above that is not.
enum class Want { kHere, kHereOrAbove };

/// Factorises K - sigma M where it is asked to, with the solver that the options name, and remembers every count.
class InertiaCounter {
 public:
  /// Problem, options, rigid modes (M-orthonormal), seconds and statistics must outlive it. to_hz: of a scaled lambda, for messages.
  InertiaCounter(const Problem& problem, const Options& options, const std::vector<petsc::VecHandle>& rigid, Seconds& seconds,
                 FactorStatistics& statistics, std::function<double(double)> to_hz);

  /// Factorises at lambda, or up to `reach` (relative) above it where lambda hits an eigenvalue, and counts. The factor is left there.
  /// Near zero, rigid modes count as below lambda whatever rounding of K has made of them. Throws SolveError when K - sigma M is singular
  /// all around, SystemError when memory does not suffice. Collective.
  Inertia take(double lambda, double reach = 1e-6, Want want = Want::kHere);

  /// The factor without numbers: what it will take. Collective.
  const ShiftedFactor& analyse();
  /// The factor of the last take; one that is analysed only if there was none, or it was released. Collective.
  ShiftedFactor& get_factor();
  /// The factor where the last take left it; null if none stands.
  ShiftedFactor* find_standing() { return stands_ ? factor_.get() : nullptr; }
  /// The next factor is one that pivots across fronts: slower, and stable where ours is not. False if it does already, or the options
  /// forbid it. Frees the factor. Collective.
  bool turn_to_mumps();
  /// Frees the factor; the next take makes another. Collective.
  void release() {
    factor_.reset();
    stands_ = false;
  }

  const std::vector<Inertia>& get_taken() const { return taken_; }
  /// The factor at sigma, where a count was taken before; factorised anew if it stands elsewhere. Throws as take() does. Collective.
  ShiftedFactor& stand_at(double sigma);
  /// A count that was taken before, by another run.
  void recall(const Inertia& taken) { taken_.push_back(taken); }
  /// Goes on from another run.
  void go_on(bool uses_mumps, double worst_backward_error);
  bool uses_mumps() const { return uses_mumps_; }
  /// Forgets counts that were taken too near an eigenvalue.
  void forget(double lambda);
  double get_worst_backward_error() const { return worst_backward_error_; }

 private:
  void make_factor();
  bool is_refused(double sigma) const;
  bool try_factorise(double sigma);
  bool try_around(double lambda, double reach);
  std::int64_t count_below();

  const Problem& problem_;
  const Options& options_;
  const std::vector<petsc::VecHandle>& rigid_;
  Seconds& seconds_;
  FactorStatistics& statistics_;
  std::function<double(double)> to_hz_;
  MPI_Comm comm_ = MPI_COMM_NULL;
  double rounding_ = 0;  // of an eigenvalue, by that of an ordinary entry of K
  bool uses_mumps_ = false;
  std::unique_ptr<ShiftedFactor> factor_;
  bool stands_ = false;  // factor_ holds the values at standing_
  double standing_ = 0;
  std::vector<Inertia> taken_;
  double worst_backward_error_ = 0;
};

}  // namespace carillon::eigen
