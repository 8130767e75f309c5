// Method:     Sylvester's law of inertia: K - sigma M = L D L^T has as many negative pivots as there are eigenvalues below sigma.
// Source:     Parlett, The symmetric eigenvalue problem, 1998, section 3.3.
// Deviations: none.
#include "precompute/eigen/inertia.hpp"

#include <fmt/core.h>

#include <algorithm>

#include "precompute/eigen/memory.hpp"
#include "precompute/eigen/timer.hpp"
#include "precompute/petsc/session.hpp"
#include "precompute/petsc/work.hpp"
#include "runtime/config/error.hpp"

namespace carillon::eigen {

InertiaCounter::InertiaCounter(const Problem& problem, const Options& options, Seconds& seconds, FactorStatistics& statistics,
                               std::function<double(double)> to_hz)
    : problem_(problem), options_(options), seconds_(seconds), statistics_(statistics), to_hz_(std::move(to_hz)) {
  petsc::check(PetscObjectGetComm(reinterpret_cast<PetscObject>(problem.stiffness), &comm_));
  uses_mumps_ = options.factorisation == Factorisation::kMumps;
}

const ShiftedFactor& InertiaCounter::analyse() {
  const petsc::WorkScope scope(petsc::WorkPhase::kFactor);
  const Timer timer(seconds_.analyse);
  factor_ = uses_mumps_ ? make_mumps_factor(problem_.stiffness, problem_.mass, problem_.nodes.elimination_position)
                        : make_ldlt_factor(problem_.stiffness, problem_.mass);
  statistics_.solver = factor_->get_solver();
  statistics_.ordering = factor_->get_ordering();
  return *factor_;
}

void InertiaCounter::make_factor() {
  analyse();
  check_memory(comm_, factor_->get_peak_bytes(), options_.memory_limit_bytes, "The factorisation of K - sigma M");
}

bool InertiaCounter::try_factorise(double sigma) {
  const petsc::WorkScope scope(petsc::WorkPhase::kFactor);
  const Timer timer(seconds_.factor);
  ++statistics_.factorisations;
  stands_ = factor_->factorise(sigma);
  if (!stands_) return false;
  standing_ = sigma;
  statistics_.entries = factor_->get_entries();
  statistics_.flops = factor_->get_flops();
  worst_backward_error_ = std::max(worst_backward_error_, factor_->get_backward_error());
  return true;
}

Inertia InertiaCounter::take(double lambda, double reach) {
  constexpr int kNudges = 5;
  while (true) {
    if (factor_ == nullptr) make_factor();
    for (int i = 0; i < kNudges; ++i) {
      const double sigma = lambda * (1 + reach * i / kNudges);
      if (!try_factorise(sigma)) continue;
      taken_.push_back({sigma, factor_->get_negative_pivots()});
      return taken_.back();
    }
    if (uses_mumps_ || options_.factorisation == Factorisation::kLdlt) break;
    uses_mumps_ = true;  // It pivots across fronts: slower, and stable where ours is not.
    release();
  }
  throw SolveError(
      fmt::format("K - sigma M is singular all around {:.6g} Hz: the mesh has nodes without mass or stiffness, or the mass matrix is "
                  "not positive definite.",
                  to_hz_(lambda)));
}

ShiftedFactor& InertiaCounter::stand_at(double sigma) {
  if (factor_ == nullptr) make_factor();
  if (stands_ && standing_ == sigma) return *factor_;
  if (try_factorise(sigma)) return *factor_;
  if (!uses_mumps_ && options_.factorisation == Factorisation::kAutomatic) {
    uses_mumps_ = true;
    release();
    make_factor();
    if (try_factorise(sigma)) return *factor_;
  }
  throw SolveError(fmt::format("K - sigma M cannot be factorised again at {:.6g} Hz, where it was before.", to_hz_(sigma)));
}

void InertiaCounter::go_on(bool uses_mumps, double worst_backward_error) {
  uses_mumps_ = uses_mumps_ || uses_mumps;
  worst_backward_error_ = worst_backward_error;
}

ShiftedFactor& InertiaCounter::get_factor() {
  if (factor_ == nullptr) make_factor();
  return *factor_;
}

void InertiaCounter::forget(double lambda) {
  std::erase_if(taken_, [&](const Inertia& taken) { return taken.lambda == lambda; });
}

}  // namespace carillon::eigen
