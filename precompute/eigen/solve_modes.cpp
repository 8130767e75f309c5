// Method:     1. The rigid modes are built in closed form and deflated. 2. The inertia of K - lambda M at both ends of the band says how
// many
//             modes it holds. 3. Krylov-Schur with shift-invert finds them, in slices when they are many; what a run leaves out is sought
//             again with everything found deflated, until the count is met. 4. Residuals and orthonormality are measured from K and M.
// Source:     Grimes, Lewis, Simon, A shifted block Lanczos algorithm, SIAM J. Matrix Anal. Appl. 15(1), 1994 (counts and slices);
//             Parlett, The symmetric eigenvalue problem, 1998, section 3.3 (inertia). Krylov-Schur: krylov.cpp.
// Deviations: single vectors instead of blocks: SLEPc's Krylov-Schur has no block form.
#include "precompute/eigen/solve_modes.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <numeric>

#include "precompute/eigen/check_input.hpp"
#include "precompute/eigen/check_modes.hpp"
#include "precompute/eigen/dense_modes.hpp"
#include "precompute/eigen/krylov.hpp"
#include "precompute/eigen/refine.hpp"
#include "precompute/eigen/rigid_modes.hpp"
#include "precompute/eigen/scaling.hpp"
#include "precompute/eigen/shifted_factor.hpp"
#include "precompute/eigen/slices.hpp"
#include "precompute/eigen/timer.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/config/error.hpp"

namespace carillon::eigen {
namespace {

using petsc::check;

constexpr PetscInt kDenseRows = 300;       // Smaller problems are solved densely straight away,
constexpr PetscInt kDenseRowsFull = 3000;  // and up to here when the band holds more than a quarter of the spectrum.
constexpr std::int64_t kSliceModes = 320;  // Beyond, Gram-Schmidt costs more than another factorisation.
constexpr double kEdgeNudge = 1e-6;        // Counts are taken this far outside the band, relative to lambda.
constexpr double kEdgeTolerance = 1e-9;    // A mode this close to an end of the band (relative to lambda) is in it.
constexpr double kZeroFraction = 1e-5;     // Of high_hz: frequencies below are zero to working precision.
constexpr int kRounds = 60;                // Krylov runs per slice at most until its count is met,
constexpr int kIdleRounds = 2;             // and so many without a new mode.
constexpr double kKrylovTolerance = 1e-2;  // Of the tolerance: Ritz residuals of the inverse leave out what K does to high frequencies.

double calc_lambda(double freq_hz) {
  const double omega_rad_s = 2 * std::numbers::pi * freq_hz;
  return omega_rad_s * omega_rad_s;
}

class BandSolver {
 public:
  BandSolver(const Problem& problem, const Options& options);
  Modes solve();

 private:
  void solve_dense_band();
  void solve_sparse_band();
  std::int64_t count_below(double lambda);
  Slice count_band();
  std::vector<Slice> cut(const Slice& band);
  void solve_slice(const Slice& slice, bool is_only);
  std::int64_t run_round(const Slice& slice, ShiftedFactor& factor, double sigma, std::int64_t wanted, double tolerance);
  void collect(const DensePairs* dense);
  void finish();
  ModeErrors refine();
  void report(Phase phase, std::int64_t done) const;
  double to_hz(double scaled_lambda) const {
    return std::sqrt(std::max(scaling_.from_scaled(scaled_lambda), 0.0)) / (2 * std::numbers::pi);
  }

  const Problem& problem_;
  const Options& options_;
  MPI_Comm comm_ = MPI_COMM_NULL;
  int rank_ = 0;
  int size_ = 1;
  PetscInt n_ = 0;
  Scaling scaling_;
  double low_ = 0;  // scaled lambda, the band's ends
  double high_ = 0;
  std::vector<petsc::VecHandle> rigid_;
  std::unique_ptr<MumpsFactor> counter_;
  Pairs found_;
  Modes modes_;
};

BandSolver::BandSolver(const Problem& problem, const Options& options)
    : problem_(problem), options_(options), scaling_(problem.stiffness, problem.mass, calc_lambda(options.high_hz)) {
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(problem.stiffness), &comm_));
  MPI_Comm_rank(comm_, &rank_);
  MPI_Comm_size(comm_, &size_);
  check(MatGetSize(problem.stiffness, &n_, nullptr));
  low_ = scaling_.to_scaled(calc_lambda(std::max(options.low_hz, kZeroFraction * options.high_hz)));
  high_ = scaling_.to_scaled(calc_lambda(options.high_hz));
}

void BandSolver::report(Phase phase, std::int64_t done) const {
  if (options_.progress && rank_ == 0)
    options_.progress({phase, done, std::min(modes_.band_count, options_.max_modes.value_or(modes_.band_count))});
}

Modes BandSolver::solve() {
  {
    const Timer total(modes_.seconds.total);
    {
      const Timer timer(modes_.seconds.rigid);
      report(Phase::kRigid, 0);
      rigid_ = make_rigid_modes(problem_.stiffness, problem_.mass, problem_.nodes);
      modes_.rigid_count = static_cast<std::int64_t>(rigid_.size());
    }
    if (n_ <= kDenseRows) {
      solve_dense_band();
    } else {
      solve_sparse_band();
    }
    const Timer timer(modes_.seconds.check);
    report(Phase::kCheck, static_cast<std::int64_t>(modes_.lambda.size()));
    finish();
  }
  MPI_Allreduce(MPI_IN_PLACE, &modes_.seconds, sizeof(Seconds) / sizeof(double), MPI_DOUBLE, MPI_MAX, comm_);
  return std::move(modes_);
}

void BandSolver::solve_dense_band() {
  DensePairs pairs;
  {
    const Timer timer(modes_.seconds.iterate);
    report(Phase::kIterate, 0);
    pairs = solve_dense(problem_.stiffness, problem_.mass);
  }
  modes_.factor = {};
  modes_.factor.solver = "LAPACK dsygv (dense)";
  modes_.factor.ordering = "none";
  const auto count_under = [&](double lambda) {
    return std::lower_bound(pairs.lambda.begin(), pairs.lambda.end(), lambda) - pairs.lambda.begin();
  };
  modes_.count_below_low = count_under(low_ * (1 - kEdgeTolerance));
  modes_.band_count = count_under(high_ * (1 + kEdgeTolerance)) - modes_.count_below_low;
  modes_.mechanism_count = count_under(low_ * 1e-4) - modes_.rigid_count;
  collect(&pairs);
}

// Eigenvalues below lambda, by the negative pivots of K - lambda M.
std::int64_t BandSolver::count_below(double lambda) {
  const Timer timer(modes_.seconds.factor);
  constexpr int kNudges = 5;
  for (int i = 0; i < kNudges; ++i) {
    ++modes_.factor.factorisations;
    if (counter_->factorise(lambda)) return counter_->get_negative_pivots();
    lambda *= 1 + kEdgeNudge * 0.1;
  }
  throw SolveError(
      fmt::format("K - sigma M is singular all around {:.6g} Hz: the mesh has nodes without mass or stiffness, or the mass matrix is "
                  "not positive definite.",
                  to_hz(lambda)));
}

Slice BandSolver::count_band() {
  report(Phase::kCount, 0);
  Slice band;
  band.low = low_ * (1 - kEdgeNudge);
  band.high = high_ * (1 + kEdgeNudge);
  band.below_high = count_below(band.high);
  band.below_low = count_below(band.low);
  modes_.count_below_low = band.below_low;
  if (band.below_low < modes_.rigid_count || band.count() < 0) {
    throw SolveError(
        fmt::format("The inertia counts {} eigenvalues below {:.6g} Hz and {} below {:.6g} Hz beside {} rigid modes: K or M is not "
                    "what a body has. Look for inverted elements.",
                    band.below_low, to_hz(band.low), band.below_high, to_hz(band.high), modes_.rigid_count));
  }
  if (band.below_low > modes_.rigid_count) modes_.mechanism_count = count_below(low_ * 1e-4) - modes_.rigid_count;
  modes_.band_count = band.count();
  return band;
}

std::vector<Slice> BandSolver::cut(const Slice& band) {
  const CountBelow count = [this](double lambda) { return count_below(lambda); };
  const Slice wanted = options_.max_modes ? cut_to_lowest(band, *options_.max_modes, count) : band;
  if (options_.factorisation == Factorisation::kCholmod) return {wanted};  // It cannot shift into the band.
  return cut_into_slices(wanted, kSliceModes, count);
}

void BandSolver::solve_sparse_band() {
  {
    const Timer timer(modes_.seconds.analyse);
    report(Phase::kAnalyse, 0);
    counter_ = std::make_unique<MumpsFactor>(problem_.stiffness, problem_.mass, problem_.nodes.elimination_position);
  }
  const Slice band = count_band();
  modes_.factor.solver = counter_->get_solver();
  modes_.factor.ordering = counter_->get_ordering();
  modes_.factor.entries = counter_->get_entries();
  modes_.factor.flops = counter_->get_flops();
  if (band.count() == 0) return;
  if (n_ <= kDenseRowsFull && 4 * band.below_high > n_) return solve_dense_band();
  const std::vector<Slice> slices = cut(band);
  for (const Slice& slice : slices) solve_slice(slice, slices.size() == 1);
  counter_.reset();
  collect(nullptr);
}

// One Krylov run; adds what lies in the slice and is new to found_, and returns how many that are.
std::int64_t BandSolver::run_round(const Slice& slice, ShiftedFactor& factor, double sigma, std::int64_t wanted, double tolerance) {
  KrylovRequest request;
  request.stiffness = problem_.stiffness;
  request.mass = problem_.mass;
  request.factor = &factor;
  request.sigma = sigma;
  request.wanted = petsc::to_petsc_int(wanted);
  request.tolerance = tolerance;
  for (const auto& vector : rigid_) request.deflated.push_back(vector);
  // Vectors far from the slice are orthogonal to it by their residuals; those near its ends or in it must be held away.
  const double margin = 0.25 * (slice.high - slice.low);
  for (std::size_t i = 0; i < found_.lambda.size(); ++i) {
    if (found_.lambda[i] > slice.low - margin && found_.lambda[i] < slice.high + margin) request.deflated.push_back(found_.vectors[i]);
  }
  const auto before = static_cast<std::int64_t>(found_.lambda.size());
  request.progress = [&](std::int64_t converged) { report(Phase::kIterate, before + converged); };
  KrylovResult result = run_krylov_schur(request);
  modes_.factor.solves += result.solves;
  modes_.seconds.solve += result.solve_seconds;
  std::int64_t added = 0;
  for (std::size_t i = 0; i < result.pairs.lambda.size(); ++i) {
    const double lambda = result.pairs.lambda[i];
    if (lambda < slice.low * (1 - kEdgeTolerance) || lambda > slice.high * (1 + kEdgeTolerance)) continue;
    found_.lambda.push_back(lambda);
    found_.vectors.push_back(std::move(result.pairs.vectors[i]));
    ++added;
  }
  return added;
}

void BandSolver::solve_slice(const Slice& slice, bool is_only) {
  if (slice.count() == 0) return;
  // From the bottom of the spectrum nothing needs to be skipped but what is deflated; a slice high up is found from its middle.
  const std::int64_t from_bottom = slice.below_high - modes_.rigid_count;
  const bool starts_at_bottom = slice.low < 0.05 * slice.high && 5 * (from_bottom - slice.count()) <= slice.count();
  const bool is_cholmod = options_.factorisation == Factorisation::kCholmod ||
                          (options_.factorisation == Factorisation::kAutomatic && size_ == 1 && is_only && starts_at_bottom);
  double sigma = std::midpoint(slice.low, slice.high);
  std::int64_t wanted = slice.count();
  if (is_cholmod) {
    sigma = -2.5e-3 * slice.high;
    wanted = from_bottom;
  } else if (starts_at_bottom) {
    sigma = std::lerp(slice.low, slice.high, 0.5);
    wanted = from_bottom;
  }
  std::unique_ptr<ShiftedFactor> cholmod;
  ShiftedFactor* factor = counter_.get();
  if (is_cholmod) {
    const Timer timer(modes_.seconds.analyse);
    counter_.reset();  // Two factors at a time would double the memory.
    cholmod = make_cholmod_factor(problem_.stiffness, problem_.mass, problem_.nodes.elimination_position);
    factor = cholmod.get();
  }
  {
    const Timer timer(modes_.seconds.factor);
    report(Phase::kFactor, static_cast<std::int64_t>(found_.lambda.size()));
    for (int i = 0; !factor->factorise(sigma); ++i) {
      if (i == 5) throw SolveError(fmt::format("K - sigma M is singular all around sigma = {:.9g}.", scaling_.from_scaled(sigma)));
      sigma += 1e-5 * (slice.high - slice.low);
    }
    ++modes_.factor.factorisations;
    modes_.factor.solver = factor->get_solver();
    modes_.factor.ordering = factor->get_ordering();
  }
  const Timer timer(modes_.seconds.iterate);
  // A run finds one copy of a repeated eigenvalue for certain; rounding brings the others, or the next runs.
  std::int64_t missing = slice.count();
  int idle = 0;
  for (int round = 0; round < kRounds && idle < kIdleRounds && missing > 0; ++round) {
    // A copy that rounding alone brings in comes late: later runs ask for some more, beyond the slice.
    const std::int64_t extra = std::min(round, 4) * 10;
    const std::int64_t added =
        run_round(slice, *factor, sigma, wanted - slice.count() + missing + extra, kKrylovTolerance * options_.tolerance);
    missing -= added;
    idle = added > 0 ? 0 : idle + 1;
  }
}

void BandSolver::collect(const DensePairs* dense) {
  const std::vector<double>& lambda = dense != nullptr ? dense->lambda : found_.lambda;
  std::vector<std::size_t> order(lambda.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return lambda[a] < lambda[b]; });
  const std::int64_t expected = std::min(modes_.band_count, options_.max_modes.value_or(modes_.band_count));
  const auto converged = static_cast<std::int64_t>(order.size());
  if (dense == nullptr && (converged < expected || (!options_.max_modes && converged > expected))) {
    throw SolveError(
        fmt::format("The band {:.6g} .. {:.6g} Hz holds {} modes by the inertia of K - lambda M, and {} converged. Take a looser "
                    "tolerance, or solve the band in parts.",
                    options_.low_hz, options_.high_hz, modes_.band_count, converged));
  }
  std::erase_if(order, [&](std::size_t i) { return lambda[i] < low_ * (1 - kEdgeTolerance) || lambda[i] > high_ * (1 + kEdgeTolerance); });
  // The counts were taken a little outside the band.
  const auto within = static_cast<std::int64_t>(order.size());
  if (dense == nullptr && (within < expected || !options_.max_modes)) modes_.band_count = within;
  if (options_.max_modes && within > *options_.max_modes) order.resize(static_cast<std::size_t>(*options_.max_modes));
  if (order.empty()) return;

  PetscInt rows = 0;
  check(MatGetLocalSize(problem_.stiffness, &rows, nullptr));
  const auto count = petsc::to_petsc_int(static_cast<std::int64_t>(order.size()));
  check(MatCreateDense(comm_, rows, PETSC_DECIDE, n_, count, nullptr, modes_.shapes.out()));
  for (PetscInt j = 0; j < count; ++j) {
    const std::size_t from = order[static_cast<std::size_t>(j)];
    modes_.lambda.push_back(lambda[from]);
    Vec column = nullptr;
    check(MatDenseGetColumnVecWrite(modes_.shapes, j, &column));
    if (dense != nullptr) {
      Vec source = nullptr;
      check(MatDenseGetColumnVecRead(dense->vectors, static_cast<PetscInt>(from), &source));
      check(VecCopy(source, column));
      check(MatDenseRestoreColumnVecRead(dense->vectors, static_cast<PetscInt>(from), &source));
    } else {
      check(VecCopy(found_.vectors[from], column));
      found_.vectors[from].reset();
    }
    check(MatDenseRestoreColumnVecWrite(modes_.shapes, j, &column));
  }
  check(MatAssemblyBegin(modes_.shapes, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(modes_.shapes, MAT_FINAL_ASSEMBLY));
  found_ = {};
}

ModeErrors BandSolver::refine() {
  RefineRequest request;
  request.stiffness = problem_.stiffness;
  request.mass = problem_.mass;
  request.tolerance = options_.tolerance;
  request.get_factor = [&]() -> ShiftedFactor& {
    if (counter_ == nullptr)
      counter_ = std::make_unique<MumpsFactor>(problem_.stiffness, problem_.mass, problem_.nodes.elimination_position);
    return *counter_;
  };
  ModeErrors errors;
  const RefineCost cost = refine_modes(request, modes_.lambda, modes_.shapes, errors);
  counter_.reset();
  modes_.factor.factorisations += cost.factorisations;
  modes_.factor.solves += cost.solves;
  for (std::size_t j = 0; j < errors.residual.size(); ++j) {
    if (is_accepted(errors, j, options_.tolerance)) continue;
    throw SolveError(
        fmt::format("Mode {} at {:.6g} Hz has the relative residual {:.2g}, above the tolerance {:.2g} and above what rounding "
                    "explains ({:.2g}). Take a looser tolerance, or mend the thinnest elements of the mesh.",
                    j, to_hz(modes_.lambda[j]), errors.residual[j], options_.tolerance, errors.floor[j]));
  }
  return errors;
}

void BandSolver::finish() {
  if (modes_.lambda.empty()) return;
  const ModeErrors errors = refine();
  modes_.residual = errors.residual;
  modes_.above_tolerance_count =
      std::count_if(errors.residual.begin(), errors.residual.end(), [&](double residual) { return residual > options_.tolerance; });
  modes_.orthonormality_error = errors.orthonormality;
  orient_shapes(modes_.shapes, problem_.nodes.position);
  check(MatScale(modes_.shapes, scaling_.get_shape_factor()));
  for (double& lambda : modes_.lambda) lambda = scaling_.from_scaled(lambda);
}

}  // namespace

Modes solve_modes(const Problem& problem, const Options& options) {
  check_input(problem, options);
  return BandSolver(problem, options).solve();
}

}  // namespace carillon::eigen
