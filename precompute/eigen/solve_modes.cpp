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

#include "precompute/eigen/check_modes.hpp"
#include "precompute/eigen/dense_modes.hpp"
#include "precompute/eigen/krylov.hpp"
#include "precompute/eigen/rigid_modes.hpp"
#include "precompute/eigen/shifted_factor.hpp"
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
constexpr int kRounds = 4;                 // Krylov runs per slice until its count is met.
constexpr double kOrthonormal = 1e-11;     // Good enough without another step of orthonormalisation.

double calc_lambda(double freq_hz) {
  const double omega_rad_s = 2 * std::numbers::pi * freq_hz;
  return omega_rad_s * omega_rad_s;
}

// Adds the time of its life to a sum.
class Timer {
 public:
  explicit Timer(double& sum) : sum_(sum), start_(MPI_Wtime()) {}
  ~Timer() { sum_ += MPI_Wtime() - start_; }
  Timer(const Timer&) = delete;
  Timer& operator=(const Timer&) = delete;

 private:
  double& sum_;
  double start_;
};

// K and M times powers of two, so that lambda is about 1 at the upper end and M about 1: thresholds of the solvers then mean what they say.
// Powers of two change no mantissa; the destructor restores every bit.
class Scaling {
 public:
  Scaling(Mat stiffness, Mat mass, double lambda_high) : stiffness_(stiffness), mass_(mass) {
    PetscScalar trace = 0;
    PetscInt n = 0;
    check(MatGetTrace(mass, &trace));
    check(MatGetSize(mass, &n, nullptr));
    if (!(trace > 0) || !std::isfinite(trace)) throw SolveError("The mass matrix has no positive trace. Look for elements without volume.");
    mass_power_ = 2 * static_cast<int>(std::lround(0.5 * std::log2(trace / n)));  // Even: its root is a power of two as well.
    lambda_power_ = static_cast<int>(std::lround(std::log2(lambda_high)));
    scale(1);
  }
  ~Scaling() {
    try {
      scale(-1);
    } catch (...) {  // Only a destroyed matrix can fail here.
    }
  }
  Scaling(const Scaling&) = delete;
  Scaling& operator=(const Scaling&) = delete;

  double to_scaled(double lambda) const { return std::ldexp(lambda, -lambda_power_); }
  double from_scaled(double lambda) const { return std::ldexp(lambda, lambda_power_); }
  double get_shape_factor() const { return std::ldexp(1.0, -mass_power_ / 2); }

 private:
  void scale(int direction) {
    check(MatScale(mass_, std::ldexp(1.0, -direction * mass_power_)));
    check(MatScale(stiffness_, std::ldexp(1.0, -direction * (mass_power_ + lambda_power_))));
  }

  Mat stiffness_;
  Mat mass_;
  int mass_power_ = 0;
  int lambda_power_ = 0;
};

// An interval of lambda (scaled) and how many eigenvalues lie below its ends.
struct Slice {
  double low = 0;
  std::int64_t below_low = 0;
  double high = 0;
  std::int64_t below_high = 0;

  std::int64_t count() const { return below_high - below_low; }
};

class BandSolver {
 public:
  BandSolver(const Problem& problem, const Options& options);
  Modes solve();

 private:
  void solve_dense_band();
  void solve_sparse_band();
  std::int64_t count_below(double lambda);
  Slice count_band();
  Slice cut_to_max_modes(const Slice& band);
  std::vector<Slice> cut_into_slices(const Slice& band);
  void solve_slice(const Slice& slice, bool is_only);
  std::int64_t run_round(const Slice& slice, ShiftedFactor& factor, double sigma, std::int64_t wanted, double tolerance);
  void collect(const DensePairs* dense);
  void finish();
  void refine(ModeErrors& errors);
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

void check_input(const Problem& problem, const Options& options) {
  if (problem.stiffness == nullptr || problem.mass == nullptr) throw InputError("The eigenproblem lacks its stiffness or mass matrix.");
  if (!(options.high_hz > options.low_hz) || !(options.low_hz >= 0) || !std::isfinite(options.high_hz)) {
    throw InputError(fmt::format("The band {} .. {} Hz is empty or negative: give two frequencies, the lower one first.", options.low_hz,
                                 options.high_hz));
  }
  if (options.max_modes && *options.max_modes < 1)
    throw InputError(fmt::format("max_modes is {}: it must be at least 1.", *options.max_modes));
  if (!(options.tolerance > 0) || options.tolerance > 1e-2) {
    throw InputError(fmt::format("The tolerance {} is out of range: take one between 1e-14 and 1e-2.", options.tolerance));
  }
  MPI_Comm comm = MPI_COMM_NULL;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(problem.stiffness), &comm));
  int size = 1;
  MPI_Comm_size(comm, &size);
  if (size > 1 && options.factorisation == Factorisation::kCholmod) {
    throw InputError(fmt::format("CHOLMOD factorises on one rank and there are {}: take MUMPS.", size));
  }
  petsc::run_agreed(comm, [&] {
    PetscInt rows = 0;
    PetscInt n = 0;
    check(MatGetLocalSize(problem.stiffness, &rows, nullptr));
    check(MatGetSize(problem.stiffness, &n, nullptr));
    const NodeLayout& nodes = problem.nodes;
    if (static_cast<std::size_t>(rows) != 3 * nodes.position.size() || nodes.position.size() != nodes.component.size()) {
      throw InputError(fmt::format("The node layout has {} positions and {} components for {} rows of the stiffness matrix.",
                                   nodes.position.size(), nodes.component.size(), rows));
    }
    for (const std::int32_t c : nodes.component) {
      if (c < 0 || c >= nodes.component_count)
        throw InputError(fmt::format("Component {} is none of the layout's {}.", c, nodes.component_count));
    }
    const std::size_t order = nodes.elimination_position.size();
    int rank = 0;
    MPI_Comm_rank(comm, &rank);
    if (rank == 0 && order != 0 && 3 * order != static_cast<std::size_t>(n)) {
      throw InputError(fmt::format("The elimination order names {} nodes of {}.", order, n / 3));
    }
  });
}

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

// Lowers the upper end until the slice holds few more than max_modes. Modes of a body lie about evenly in frequency: cut there.
Slice BandSolver::cut_to_max_modes(const Slice& band) {
  if (!options_.max_modes || *options_.max_modes >= band.count()) return band;
  const std::int64_t wanted = *options_.max_modes;
  const std::int64_t enough = wanted + std::max<std::int64_t>(10, wanted / 4);
  Slice cut = band;
  double too_low = band.low;
  std::int64_t below_too_low = band.below_low;
  for (int i = 0; i < 8 && cut.count() > enough; ++i) {
    const auto goal = static_cast<double>(band.below_low + (wanted + enough) / 2 - below_too_low);
    const double part = std::clamp(goal / static_cast<double>(cut.below_high - below_too_low), 0.05, 0.95);
    const double root = std::lerp(std::sqrt(too_low), std::sqrt(cut.high), part);
    const double trial = root * root;
    const std::int64_t below = count_below(trial);
    if (below - band.below_low >= wanted) {
      cut.high = trial;
      cut.below_high = below;
    } else {
      too_low = trial;
      below_too_low = below;
    }
  }
  return cut;
}

std::vector<Slice> BandSolver::cut_into_slices(const Slice& band) {
  const double width = band.high - band.low;
  if (band.count() <= kSliceModes || width < 1e-4 * band.high || options_.factorisation == Factorisation::kCholmod) return {band};
  const auto parts = static_cast<double>((band.count() + kSliceModes - 1) / kSliceModes);
  const double root = std::lerp(std::sqrt(band.low), std::sqrt(band.high), std::floor(parts / 2) / parts);
  Slice left = band;
  left.high = root * root;
  left.below_high = count_below(left.high);
  Slice right = band;
  right.low = left.high;
  right.below_low = left.below_high;
  std::vector<Slice> slices = cut_into_slices(left);
  for (const Slice& slice : cut_into_slices(right)) slices.push_back(slice);
  return slices;
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
  const std::vector<Slice> slices = cut_into_slices(cut_to_max_modes(band));
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
  std::int64_t missing = slice.count();
  double tolerance = 1e-2 * options_.tolerance;
  for (int round = 0; round < kRounds && missing > 0; ++round) {
    missing -= run_round(slice, *factor, sigma, round == 0 ? wanted : wanted - slice.count() + missing, tolerance);
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

// Inverse iteration for the modes whose residual is too large, then one step of orthonormalisation for all.
void BandSolver::refine(ModeErrors& errors) {
  const auto is_bad = [&](std::size_t j) { return !(errors.residual[j] <= std::max(options_.tolerance, errors.floor[j])); };
  std::vector<std::size_t> bad;
  for (std::size_t j = 0; j < errors.residual.size(); ++j) {
    if (is_bad(j)) bad.push_back(j);
  }
  if (bad.empty()) return;
  if (counter_ == nullptr) counter_ = std::make_unique<MumpsFactor>(problem_.stiffness, problem_.mass, problem_.nodes.elimination_position);
  double sigma = std::lerp(low_, high_, 0.5);
  while (!counter_->factorise(sigma)) sigma *= 1 + 1e-5;
  ++modes_.factor.factorisations;
  petsc::VecHandle right;
  petsc::VecHandle work;
  check(MatCreateVecs(problem_.stiffness, right.out(), work.out()));
  for (const std::size_t j : bad) {
    Vec column = nullptr;
    check(MatDenseGetColumnVec(modes_.shapes, static_cast<PetscInt>(j), &column));
    check(MatMult(problem_.mass, column, right));
    counter_->solve(right, column);
    ++modes_.factor.solves;
    PetscScalar stiffness = 0;
    PetscScalar mass = 0;
    check(MatMult(problem_.stiffness, column, work));
    check(VecDot(column, work, &stiffness));
    check(MatMult(problem_.mass, column, work));
    check(VecDot(column, work, &mass));
    check(VecScale(column, 1 / std::sqrt(mass)));
    check(MatDenseRestoreColumnVec(modes_.shapes, static_cast<PetscInt>(j), &column));
    modes_.lambda[j] = stiffness / mass;
  }
  counter_.reset();
  orthonormalise_shapes(problem_.mass, modes_.shapes);
  errors = normalise_and_measure(problem_.stiffness, problem_.mass, modes_.lambda, modes_.shapes);
  for (const std::size_t j : bad) {
    if (is_bad(j)) {
      throw SolveError(
          fmt::format("Mode {} at {:.6g} Hz has the relative residual {:.2g}, above the tolerance {:.2g} and above what rounding "
                      "explains ({:.2g}). Take a looser tolerance, or mend the thinnest elements of the mesh.",
                      j, to_hz(modes_.lambda[j]), errors.residual[j], options_.tolerance, errors.floor[j]));
    }
  }
}

void BandSolver::finish() {
  if (modes_.lambda.empty()) return;
  ModeErrors errors = normalise_and_measure(problem_.stiffness, problem_.mass, modes_.lambda, modes_.shapes);
  if (errors.orthonormality > kOrthonormal) {  // Modes of different slices, or of different runs.
    orthonormalise_shapes(problem_.mass, modes_.shapes);
    errors = normalise_and_measure(problem_.stiffness, problem_.mass, modes_.lambda, modes_.shapes);
  }
  refine(errors);
  constexpr double kDependent = 1e-6;
  if (!(errors.orthonormality < kDependent)) {
    throw SolveError(
        fmt::format("The modes that converged are not M-orthogonal (error {:.2g}): some are the same. Solve the band in parts.",
                    errors.orthonormality));
  }
  modes_.residual = errors.residual;
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
