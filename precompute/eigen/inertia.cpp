// Method: Sylvester's law of inertia: A = K - sigma M = L D L^T has as many negative pivots as there are eigenvalues below sigma. Rounding
// of K moves the eigenvalues of rigid motions, R, off zero to either side, possibly past a small sigma. The count then excludes them: A on
// the vectors M-orthogonal to R has n(A) + n(S) - dim R negative eigenvalues, n(A) those of A and n(S) those of S = -(M R)^T A^-1 M R, by
// two block eliminations of [A, M R; (M R)^T, 0].
// Source: Parlett, The symmetric eigenvalue problem, 1998, section 3.3; Haynsworth, Linear Algebra Appl. 1, 1968 (additivity of inertia);
// Gould, Math. Program. 32, 1985 (inertia on a subspace).
#include "precompute/eigen/inertia.hpp"

#include <fmt/core.h>

#include <algorithm>

#include "precompute/eigen/memory.hpp"
#include "precompute/eigen/timer.hpp"
#include "precompute/la/block_kernels.hpp"
#include "precompute/la/lapack.hpp"
#include "precompute/petsc/session.hpp"
#include "precompute/petsc/work.hpp"
#include "runtime/base/error.hpp"

namespace carillon::eigen {
namespace {

using petsc::check;

constexpr double kRigidRange = 1e4;     // Times rounding_: below this shift, rigid modes may be on either side.
constexpr double kRoundingRange = 1e3;  // Times rounding_: below this shift, rounding may prevent factorisation.
constexpr double kMinShift = 1e-3;      // Times rounding_: lowest shift tried.
constexpr double kShiftStep = 16;       // Ratio of successive shifts: four times the frequency.

}  // namespace

InertiaCounter::InertiaCounter(const la::Pencil& pencil, const Problem& problem, const Options& options,
                               const std::vector<petsc::VecHandle>& rigid, Seconds& seconds, FactorStatistics& statistics,
                               std::function<double(double)> to_hz)
    : pencil_(pencil),
      problem_(problem),
      options_(options),
      rigid_(rigid),
      seconds_(seconds),
      statistics_(statistics),
      to_hz_(std::move(to_hz)),
      comm_(petsc::get_communicator(problem.stiffness)) {
  PetscScalar k = 0, m = 0;
  check(MatGetTrace(problem.stiffness, &k));
  check(MatGetTrace(problem.mass, &m));
  rounding_ = PETSC_MACHINE_EPSILON * (pencil.stiffness_factor * k) / (pencil.mass_factor * m);
  uses_mumps_ = options.factorisation == Factorisation::kMumps;
}

const ShiftedFactor& InertiaCounter::analyse() {
  const petsc::WorkScope scope(petsc::WorkPhase::kFactor);
  const Timer timer(seconds_.analyse);
  factor_ =
      uses_mumps_ ? make_mumps_factor(pencil_, problem_.nodes.elimination_position) : make_ldlt_factor(pencil_, problem_.nodes.order.get());
  statistics_.solver = factor_->get_solver();
  statistics_.ordering = factor_->get_ordering();
  return *factor_;
}

void InertiaCounter::make_factor() {
  analyse();
  check_memory(comm_, factor_->get_peak_bytes(), options_.memory_limit_bytes, "The factorisation of K - sigma M");
}

bool InertiaCounter::is_refused(double sigma) const {
  if (uses_mumps_ || !options_.refused_shifts_hz) return false;
  const auto [low, high] = *options_.refused_shifts_hz;
  return to_hz_(sigma) >= low && to_hz_(sigma) <= high;
}

bool InertiaCounter::try_factorise(double sigma) {
  const petsc::WorkScope scope(petsc::WorkPhase::kFactor);
  const Timer timer(seconds_.factor);
  ++statistics_.factorisations;
  is_current_ = !is_refused(sigma) && factor_->factorise(sigma);
  if (!is_current_) return false;
  sigma_ = sigma;
  statistics_.entries = factor_->get_entries();
  statistics_.flops = factor_->get_flops();
  worst_backward_error_ = std::max(worst_backward_error_, factor_->get_backward_error());
  return true;
}

bool InertiaCounter::try_around(double lambda, double reach) {
  constexpr int kNudges = 5;
  if (factor_ == nullptr) make_factor();
  for (int i = 0; i < kNudges; ++i) {
    if (!try_factorise(lambda * (1 + reach * i / kNudges))) continue;
    counts_.push_back({sigma_, count_negative()});
    return true;
  }
  return false;
}

// Eigenvalues below the current shift, counting all rigid modes.
std::int64_t InertiaCounter::count_negative() {
  const std::int64_t all = factor_->get_negative_pivots();
  const auto rigid = static_cast<int>(rigid_.size());
  if (rigid == 0 || sigma_ > kRigidRange * rounding_) return all;
  petsc::VecHandle image;
  PetscInt rows = 0;
  check(MatCreateVecs(problem_.mass, nullptr, image.out()));
  check(VecGetLocalSize(image, &rows));
  const auto size = static_cast<std::size_t>(rows) * rigid_.size();
  std::vector<double> space(2 * size);
  const Columns images{space.data(), rows, rows, rigid};
  const Columns solved{space.data() + size, rows, rows, rigid};
  for (int j = 0; j < rigid; ++j) {
    const PetscScalar* values = nullptr;
    check(MatMult(problem_.mass, rigid_[j], image));
    check(VecGetArrayRead(image, &values));
    std::transform(values, values + rows, images.column(j), [&](double x) { return pencil_.mass_factor * x; });
    check(VecRestoreArrayRead(image, &values));
  }
  factor_->solve(images.values, solved.values, solved.stride, rigid);
  statistics_.solves += rigid;
  la::Matrix s = multiply_transposed(comm_, images, solved);
  s = (0.5 * (s + s.transpose())).eval();
  la::Vector values;
  comm_.agree([&] {
    if (comm_.is_root() && la::calc_eigenpairs(s, values) != 0) throw SolveError("The dense eigensolver failed on the rigid motions.");
  });
  const auto positive = comm_.broadcast(std::int64_t{(values.array() > 0).count()});
  return all + positive;  // all + n(S) - dim R without the rigid modes, plus dim R; n(S) from -s
}

Inertia InertiaCounter::count_below(double lambda, double reach, ShiftRule rule) {
  if (rule == ShiftRule::kMayMoveUp) lambda = std::max(lambda, kMinShift * rounding_);
  for (; rule == ShiftRule::kMayMoveUp && lambda <= kRoundingRange * rounding_; lambda *= kShiftStep)
    if (try_around(lambda, reach)) return counts_.back();
  while (true) {
    if (try_around(lambda, reach)) return counts_.back();
    if (!switch_to_mumps()) break;
  }
  throw SolveError(
      fmt::format("K - sigma M is singular all around {:.6g} Hz: the mesh has nodes without mass or stiffness, or the mass matrix is "
                  "not positive definite.",
                  to_hz_(lambda)));
}

bool InertiaCounter::switch_to_mumps() {
  if (uses_mumps_ || options_.factorisation == Factorisation::kLdlt) return false;
  uses_mumps_ = true;
  release();
  return true;
}

ShiftedFactor& InertiaCounter::factor_at(double sigma) {
  if (factor_ == nullptr) make_factor();
  if (is_current_ && sigma_ == sigma) return *factor_;
  if (try_factorise(sigma)) return *factor_;
  if (!uses_mumps_ && options_.factorisation == Factorisation::kAutomatic) {
    uses_mumps_ = true;
    release();
    make_factor();
    if (try_factorise(sigma)) return *factor_;
  }
  throw SolveError(fmt::format("K - sigma M cannot be factorised again at {:.6g} Hz, where it was before.", to_hz_(sigma)));
}

void InertiaCounter::resume(bool uses_mumps, double worst_backward_error) {
  uses_mumps_ = uses_mumps_ || uses_mumps;
  worst_backward_error_ = worst_backward_error;
}

ShiftedFactor& InertiaCounter::get_factor() {
  if (factor_ == nullptr) make_factor();
  return *factor_;
}

void InertiaCounter::forget(double lambda) {
  std::erase_if(counts_, [&](const Inertia& taken) { return taken.lambda == lambda; });
}

}  // namespace carillon::eigen
