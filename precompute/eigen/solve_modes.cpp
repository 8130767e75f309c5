// The band from count to proof: one object, one state; longer than most files.
// Method:     1. The rigid modes are built in closed form and deflated. 2. The inertia of K - lambda M at both ends of the band says how
//             many modes it holds; many are gone through in slices. 3. Block Lanczos with a shift inside the slice finds them;
//             copies of repeated eigenvalues that a run leaves out are sought again with everything found deflated. 4. Every count, those
//             at the shifts too, must agree with the modes found below it. 5. Clusters get a canonical basis; residuals and
//             orthonormality are measured from K and M.
// Source:     Grimes, Lewis, Simon, A shifted block Lanczos algorithm, SIAM J. Matrix Anal. Appl. 15(1), 1994 (counts and slices);
//             Parlett, The symmetric eigenvalue problem, 1998, section 3.3 (inertia). Block Lanczos: block_lanczos.cpp.
// Deviations: none.
#include "precompute/eigen/solve_modes.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numbers>
#include <numeric>

#include "precompute/eigen/canonical.hpp"
#include "precompute/eigen/check_input.hpp"
#include "precompute/eigen/check_modes.hpp"
#include "precompute/eigen/dense_modes.hpp"
#include "precompute/eigen/inertia.hpp"
#include "precompute/eigen/krylov.hpp"
#include "precompute/eigen/local_columns.hpp"
#include "precompute/eigen/memory.hpp"
#include "precompute/eigen/needs.hpp"
#include "precompute/eigen/refine.hpp"
#include "precompute/eigen/rigid_modes.hpp"
#include "precompute/eigen/scaling.hpp"
#include "precompute/eigen/search_keeper.hpp"
#include "precompute/eigen/slices.hpp"
#include "precompute/eigen/timer.hpp"
#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::eigen {
namespace {

using petsc::check;

constexpr double kSurelyApart = 1e-6;     // Modes farther apart than this, relative to lambda, are no group.
constexpr double kEdgeTolerance = 1e-9;   // A mode this close to an end of the band (relative to lambda) is in it.
constexpr double kSafeMargin = 1e-7;      // Counts nearer to a mode (relative to lambda) are taken again, farther from it.
constexpr double kDenseRounding = 1e4;    // Of epsilon times the largest ratio of the diagonals: far above what LAPACK leaves of it.
constexpr double kDenseStill = 1e3;       // Of the same: eigenvalues below are zero as far as LAPACK can tell,
constexpr double kStill = 1e2;            // or a count by inertia.
constexpr double kSlow = 1e-4;            // Of the band's lower end: no mechanism is faster.
constexpr int kRounds = 60;               // Krylov runs per interval at most until its count is met,
constexpr int kIdleRounds = 2;            // and so many without a new mode.
constexpr double kLockedMargin = 1;       // Of a slice's width: modes found that near are held away.
constexpr double kKrylovTolerance = 0.1;  // Of the tolerance: Ritz residuals of the inverse leave out what K does to high frequencies.
constexpr double kWorstResidual = 1e-4;   // Of a mode that rounding alone has spoilt: a bank takes none above.
constexpr int kBases = 3;                 // of equal modes that are tried anew, because their residuals added up.

std::vector<Inertia> sort_counts(std::vector<Inertia> counts) {
  std::sort(counts.begin(), counts.end(), [](const Inertia& a, const Inertia& b) { return a.lambda < b.lambda; });
  return counts;
}

MPI_Comm find_comm(Mat matrix) {
  MPI_Comm comm = MPI_COMM_NULL;
  check(PetscObjectGetComm(reinterpret_cast<PetscObject>(matrix), &comm));
  return comm;
}

// Modes of a slice that are still to be found.
struct Missing {
  std::int64_t count = 0;
  bool is_known = true;  // by inertia, or guessed
};

class BandSolver {
 public:
  BandSolver(const Problem& problem, const Options& options);
  Modes solve();

 private:
  Modes solve_band();
  std::string explain() const;
  void find_fastest();
  bool is_dense_exact() const;
  void solve_dense_band();
  void make_counter();
  void solve_sparse_band();
  Slice count_band();
  Slice cut(const Slice& band);
  void solve_in_slices(const Slice& band);
  void find_missing(const Slice& slice, double sigma);
  void run_rounds(const Slice& slice, ShiftedFactor* cholmod, double sigma, int first);
  double run_round(const Slice& slice, ShiftedFactor* cholmod, double sigma, Missing missing, int round);
  Inertia take(double lambda, double reach = 1e-6, Want want = Want::kHere);
  std::int64_t count_found(double low, double high) const;
  double find_margin(double lambda) const;
  void move_doubtful_counts();
  bool move_counts_to_band();
  double find_end_of_search() const;
  void prove();
  void describe_proof();
  void take_found();
  void collect(const DensePairs& dense);
  void check_range(std::vector<std::size_t>& order, const std::vector<double>& lambda);
  void measure_margins();
  void drop_beyond_limit();
  void finish();
  RefineRequest make_refine_request(double tolerance);
  template <class Step>
  void add_cost(Step&& step);
  void certify(ModeErrors& errors);
  void refine(double tolerance, ModeErrors& errors);
  void choose_basis(ModeErrors& errors);
  void report(Phase phase, std::int64_t done, std::int64_t more_solves = 0) const;
  bool is_below_band(double lambda) const { return lambda < low_ * (1 - kEdgeTolerance); }
  bool is_above_band(double lambda) const { return lambda > high_ * (1 + kEdgeTolerance); }
  double to_hz(double scaled_lambda) const {
    return std::sqrt(std::max(scaling_.from_scaled(scaled_lambda), 0.0)) / (2 * std::numbers::pi);
  }

  const Problem& problem_;
  const Options& options_;
  MPI_Comm comm_ = MPI_COMM_NULL;
  int rank_ = 0;
  PetscInt n_ = 0;
  Scaling scaling_;
  double low_ = 0;  // scaled lambda, the band's ends
  double high_ = 0;
  double fastest_ = 0;          // about the greatest eigenvalue
  double sought_to_ = 0;        // the end of the last slice
  std::vector<double> others_;  // modes found and not taken: outside the band, or beyond max_modes
  std::vector<petsc::VecHandle> rigid_;
  std::unique_ptr<Operators> operators_;
  std::unique_ptr<InertiaCounter> counter_;
  FoundModes found_;
  Modes modes_;
  SearchKeeper keeper_;
};

BandSolver::BandSolver(const Problem& problem, const Options& options)
    : problem_(problem),
      options_(options),
      comm_(find_comm(problem.stiffness)),
      scaling_(problem.stiffness, problem.mass, find_ends(options).high),
      keeper_(comm_, options.checkpoint, {&found_, &modes_.factor, nullptr}) {
  MPI_Comm_rank(comm_, &rank_);
  check(MatGetSize(problem.stiffness, &n_, nullptr));
  low_ = scaling_.to_scaled(find_ends(options).low);
  high_ = scaling_.to_scaled(find_ends(options).high);
}

void BandSolver::report(Phase phase, std::int64_t done, std::int64_t more_solves) const {
  if (!options_.progress || rank_ != 0) return;
  const FactorStatistics& factor = modes_.factor;
  options_.progress({phase, done, std::min(modes_.band_count, options_.max_modes.value_or(modes_.band_count)), factor.flops, factor.entries,
                     factor.factorisations, factor.solves + more_solves});
}

/// Collective.
void BandSolver::find_fastest() {
  for (std::size_t i = 0; i < operators_->stiffness_diagonal.size(); ++i)
    fastest_ = std::max(fastest_, operators_->stiffness_diagonal[i] / operators_->mass_diagonal[i]);
  MPI_Allreduce(MPI_IN_PLACE, &fastest_, 1, MPI_DOUBLE, MPI_MAX, comm_);
}

/// What makes an error of the solve likely, as a sentence for the user: rounding in K moves squared frequencies by about its epsilon times
/// the greatest. Not collective: an error may be one rank's alone.
std::string BandSolver::explain() const {
  constexpr double kSafe = 30;  // times that rounding, squared frequencies keep their digits
  const double rounding = PETSC_MACHINE_EPSILON * fastest_;
  if (low_ > kSafe * rounding) return {};
  return fmt::format(
      " The body is so thin, or its elements so small, that rounding in K alone moves its squared frequencies by ({:.2g} Hz)^2: let the "
      "band begin "
      "at {:.2g} Hz or above.",
      to_hz(rounding), to_hz(kSafe * rounding));
}

Modes BandSolver::solve() {
  try {
    return solve_band();
  } catch (const SolveError& error) {
    throw SolveError(error.what() + explain());
  }
}

Modes BandSolver::solve_band() {
  {
    const Timer total(modes_.seconds.total);
    {
      const Timer timer(modes_.seconds.rigid);
      report(Phase::kRigid, 0);
      check_memory(comm_, calc_copies_bytes(problem_), options_.memory_limit_bytes, "The eigensolver's copy of K and M");
      rigid_ = make_rigid_modes(problem_.stiffness, problem_.mass, problem_.nodes, modes_.proof.rigid_per_component);
      modes_.rigid_count = static_cast<std::int64_t>(rigid_.size());
      operators_ = std::make_unique<Operators>(problem_.stiffness, problem_.mass);
      find_fastest();
    }
    if ((n_ <= kDenseRows || options_.method == Method::kDense) && is_dense_exact()) {
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

// Whether the lowest eigenvalue of the band stands out of what LAPACK's rounding, a part of the largest of all, does to every one.
bool BandSolver::is_dense_exact() const { return low_ > kDenseRounding * PETSC_MACHINE_EPSILON * fastest_; }

void BandSolver::solve_dense_band() {
  check_memory(comm_, calc_dense_bytes(n_), options_.memory_limit_bytes, "The dense solve");
  DensePairs pairs;
  {
    const Timer timer(modes_.seconds.iterate);
    report(Phase::kIterate, 0);
    pairs = solve_dense(problem_.stiffness, problem_.mass);
  }
  modes_.factor = {};
  modes_.factor.solver = "LAPACK dsygvd (dense)";
  modes_.factor.ordering = "none";
  const auto count_under = [&](double lambda) {
    return std::lower_bound(pairs.lambda.begin(), pairs.lambda.end(), lambda) - pairs.lambda.begin();
  };
  // As far outside the band, and short of the next mode there.
  double low = low_ * (1 - kEdgeNudge);
  double high = high_ * (1 + kEdgeNudge);
  for (const double lambda : pairs.lambda) {
    if (is_below_band(lambda)) low = std::max(low, std::midpoint(lambda, low_));
    if (is_above_band(lambda)) high = std::min(high, std::midpoint(lambda, high_));
  }
  modes_.count_below_low = count_under(low);
  modes_.band_count = count_under(high) - modes_.count_below_low;
  modes_.mechanism_count = std::max<std::int64_t>(0, count_under(kDenseStill * PETSC_MACHINE_EPSILON * fastest_) - modes_.rigid_count);
  Proof& proof = modes_.proof;
  proof.found = modes_.band_count;
  proof.method = fmt::format("all {} eigenvalues of the dense problem (LAPACK dsygvd), counted", n_);
  for (const double end : {low, high}) {
    double margin = std::numeric_limits<double>::infinity();
    for (const double lambda : pairs.lambda) margin = std::min(margin, std::abs(lambda - end) / end);
    proof.counts.push_back({to_hz(end), count_under(end), margin});
  }
  collect(pairs);
}

Slice BandSolver::count_band() {
  report(Phase::kCount, 0);
  const Slice band = count_between([this](double lambda, double reach, Want want) { return take(lambda, reach, want); }, low_, high_);
  low_ = std::max(low_, band.low);
  modes_.count_below_low = band.below_low;
  if (band.below_low < modes_.rigid_count || band.count() < 0) {
    throw SolveError(
        fmt::format("The inertia counts {} eigenvalues below {:.6g} Hz and {} below {:.6g} Hz beside {} rigid modes: K or M is not "
                    "what a body has. Look for inverted elements.",
                    band.below_low, to_hz(band.low), band.below_high, to_hz(band.high), modes_.rigid_count));
  }
  if (band.below_low > modes_.rigid_count) {
    constexpr double kReach = 1e-6;
    const double slow = kSlow * low_;
    const Inertia still = take(std::min(slow, kStill * PETSC_MACHINE_EPSILON * fastest_), kReach, Want::kHereOrAbove);
    // Where rounding hides what is so slow, slow modes would be taken for mechanisms.
    if (still.lambda <= slow * (1 + kReach)) modes_.mechanism_count = std::max<std::int64_t>(0, still.below - modes_.rigid_count);
    if (still.lambda != band.low) counter_->forget(still.lambda);
  }
  modes_.band_count = band.count();
  return band;
}

// The part of the band that holds the modes wanted.
Slice BandSolver::cut(const Slice& band) {
  if (!options_.max_modes) return band;
  return cut_to_lowest(band, *options_.max_modes, [this](double lambda) { return take(lambda).below; });
}

// A count, or what is remembered of it.
Inertia BandSolver::take(double lambda, double reach, Want want) {
  SearchStep step;
  step.asked = {lambda, reach, want == Want::kHereOrAbove ? 1.0 : 0.0};
  if (const SearchStep* known = keeper_.recall(step)) {
    const Inertia taken{known->answer[0], static_cast<std::int64_t>(known->answer[1])};
    counter_->recall(taken);
    return taken;
  }
  const Inertia taken = counter_->take(lambda, reach, want);
  step.answer = {taken.lambda, static_cast<double>(taken.below)};
  keeper_.record(step);
  return taken;
}

void BandSolver::make_counter() {
  counter_ =
      std::make_unique<InertiaCounter>(problem_, options_, rigid_, modes_.seconds, modes_.factor, [this](double x) { return to_hz(x); });
  keeper_.set_counter(counter_.get());
}

void BandSolver::solve_sparse_band() {
  report(Phase::kAnalyse, 0);
  keeper_.start(n_, scaling_.get_powers());
  make_counter();
  const Slice band = count_band();
  if (band.count() == 0) return describe_proof();
  const std::int64_t last = std::min(band.below_high, band.below_low + options_.max_modes.value_or(band.count()));
  if (n_ <= kDenseRowsFull && static_cast<double>(last) > kDenseShare * n_ && is_dense_exact()) {
    keeper_.set_counter(nullptr);
    counter_.reset();
    return solve_dense_band();
  }
  const Slice wanted = cut(band);
  sought_to_ = wanted.high;
  PetscInt rows = 0;
  check(MatGetLocalSize(problem_.stiffness, &rows, nullptr));
  check_memory(comm_, calc_search_bytes(rows, wanted.count(), modes_.rigid_count), options_.memory_limit_bytes,
               fmt::format("The search for {} modes", wanted.count()));
  found_.reset(problem_.stiffness, petsc::to_petsc_int(wanted.count()), rigid_);
  keeper_.load_found();
  solve_in_slices(wanted);
  prove();
  describe_proof();
  take_found();
}

std::int64_t BandSolver::count_found(double low, double high) const {
  return std::count_if(found_.lambda.begin(), found_.lambda.end(), [&](double lambda) { return lambda >= low && lambda < high; });
}

// One Krylov run; adds to found_ what lies in the slice and was not there. Returns up to where from sigma on it left nothing out.
double BandSolver::run_round(const Slice& slice, ShiftedFactor* cholmod, double sigma, Missing missing, int round) {
  SearchStep step;
  step.kind = SearchStep::kRound;
  step.asked = {sigma, slice.low, slice.high, static_cast<double>(missing.count), round + (missing.is_known ? 0.0 : 0.5)};
  if (const SearchStep* known = keeper_.recall(step)) {
    keeper_.show_found(*known);
    return known->answer[0];
  }
  ShiftedFactor& factor = cholmod != nullptr ? *cholmod : counter_->stand_at(sigma);
  const Timer timer(modes_.seconds.iterate);
  KrylovRequest request;
  request.stiffness = problem_.stiffness;
  request.mass = problem_.mass;
  request.mass_blocks = &operators_->mass;
  request.factor = &factor;
  request.sigma = sigma;
  request.low = slice.low * (1 - kEdgeTolerance);
  request.high = slice.high * (1 + kEdgeTolerance);
  request.count = petsc::to_petsc_int(missing.count);
  request.is_count_known = missing.is_known;
  // Those below the slice are nearer the shift than its upper end when it starts at the bottom. Copies that rounding alone brings in come
  // late: later runs ask for some more, beyond the slice.
  const bool is_below = sigma - slice.low * 0.5 > slice.high - sigma || sigma < slice.low;
  const std::int64_t below = slice.below_low - modes_.rigid_count;
  request.nearest = petsc::to_petsc_int(missing.count + (is_below || 5 * below <= slice.count() ? below : 0) + std::min(round, 4) * 10);
  request.method = options_.method;
  request.tolerance = kKrylovTolerance * options_.tolerance;
  request.position = &problem_.nodes.position;
  request.round = round;
  // Vectors far from the slice are orthogonal to it by their residuals; those near its ends or in it must be held away, and fewer
  // neighbours make the iteration shorter.
  request.locked_above = slice.low - kLockedMargin * (slice.high - slice.low);
  const auto before = static_cast<std::int64_t>(found_.lambda.size());
  request.progress = [&](std::int64_t converged, std::int64_t solves) { report(Phase::kIterate, before + converged, solves); };
  request.keeper = keeper_.begin_round(step);
  const KrylovStatistics statistics = run_krylov(request, found_);
  modes_.factor.solves += statistics.solves;
  modes_.seconds.solve += statistics.solve_seconds;
  keeper_.end_round();
  step.answer = {statistics.solved_to};
  keeper_.record(step);
  return statistics.solved_to;
}

// Runs around sigma, where the factor stands or will be put, until the slice holds what it was counted to hold.
void BandSolver::find_missing(const Slice& slice, double sigma) {
  std::unique_ptr<ShiftedFactor> cholmod;
  if (options_.factorisation == Factorisation::kCholmod) {
    counter_->release();  // Two factors at a time would double the memory.
    const Timer timer(modes_.seconds.factor);
    sigma = -2.5e-3 * slice.high;
    cholmod = make_cholmod_factor(problem_.stiffness, problem_.mass, problem_.nodes.elimination_position);
    ++modes_.factor.factorisations;
    (void)cholmod->factorise(sigma);
    modes_.factor.solver = cholmod->get_solver();
    modes_.factor.ordering = cholmod->get_ordering();
    modes_.factor.entries = cholmod->get_entries();
  } else {
    report(Phase::kFactor, static_cast<std::int64_t>(found_.lambda.size()));
    sigma = take(sigma, 1e-5).lambda;
  }
  run_rounds(slice, cholmod.get(), sigma, 0);
}

// Runs with the factor at sigma until the slice holds what it was counted to hold, or runs find nothing new.
void BandSolver::run_rounds(const Slice& slice, ShiftedFactor* cholmod, double sigma, int first) {
  int idle = 0;
  for (int round = first; round < kRounds && idle < kIdleRounds; ++round) {
    const std::int64_t missing = slice.count() - count_found(slice.low * (1 - kEdgeTolerance), slice.high * (1 + kEdgeTolerance));
    if (missing <= 0) break;
    const std::size_t before = found_.lambda.size();
    run_round(slice, cholmod, sigma, {missing, true}, round);
    idle = found_.lambda.size() > before ? 0 : idle + 1;
  }
}

void BandSolver::solve_in_slices(const Slice& band) {
  // CHOLMOD cannot shift into the band.
  const std::int64_t most = options_.factorisation == Factorisation::kCholmod ? band.count() : kSliceModes;
  Sweep sweep(band, most, [this](double lambda) {
    report(Phase::kFactor, static_cast<std::int64_t>(found_.lambda.size()));
    return take(lambda).below;
  });
  Slice counted = band;  // between shifts, where counts are exact
  while (!sweep.is_last()) {
    const Sweep::Part part = sweep.take();
    counted.high = part.sigma;
    counted.below_high = part.below_sigma;
    const double solved_to = run_round(part.slice, nullptr, part.sigma, {part.slice.count(), false}, 0);
    if (count_found(counted.low, counted.high) >= counted.count()) {
      sweep.advance(solved_to, band.below_low + count_found(band.low * (1 - kEdgeTolerance), solved_to));
    } else {
      // Copies are missing below the shift, and above it no doubt too. Left for later they would count as modes of the slices to come.
      run_rounds(counted, nullptr, part.sigma, 1);
      sweep.advance(part.sigma, part.below_sigma);
    }
    counted.low = part.sigma;
    counted.below_low = part.below_sigma;
  }
  const Slice& rest = sweep.get_rest();
  if (rest.count() > 0) find_missing(rest, std::midpoint(rest.low, rest.high));
}

// Distance of the nearest mode found, relative to lambda.
double BandSolver::find_margin(double lambda) const {
  double margin = std::numeric_limits<double>::infinity();
  for (const double found : found_.lambda) margin = std::min(margin, std::abs(found - lambda) / lambda);
  return margin;
}

// A count whose shift came to lie on a mode is worth nothing: it is taken again in the widest gap nearby.
void BandSolver::move_doubtful_counts() {
  std::vector<double> sorted = found_.lambda;
  std::sort(sorted.begin(), sorted.end());
  const std::vector<Inertia> taken = counter_->get_taken();
  for (const Inertia& old : taken) {
    if (find_margin(old.lambda) >= kSafeMargin) continue;
    double best = 0;
    double place = 0;
    for (std::size_t j = 1; j < sorted.size(); ++j) {
      const double middle = std::midpoint(sorted[j - 1], sorted[j]);
      const double gap = sorted[j] - sorted[j - 1];
      const double distance = std::abs(middle - old.lambda);
      if (gap / (gap + distance) > best) {
        best = gap / (gap + distance);
        place = middle;
      }
    }
    const bool is_end = old.lambda >= high_ || old.lambda <= low_;  // An end may only move outwards.
    if (is_end) place = old.lambda * (old.lambda >= high_ ? 1 + 10 * kSafeMargin : 1 - 10 * kSafeMargin);
    if (place == 0) continue;
    counter_->forget(old.lambda);
    (void)take(place);
  }
}

// A mode between an end of the band and the count beside it would be counted and is not of the band: the count is taken anew between them.
// True if one was.
bool BandSolver::move_counts_to_band() {
  bool has_moved = false;
  for (const bool is_high : {false, true}) {
    const std::vector<Inertia> counts = sort_counts(counter_->get_taken());
    const Inertia old = is_high ? counts.back() : counts.front();
    double nearest = old.lambda;
    for (const double lambda : found_.lambda) {
      if (is_high && is_above_band(lambda)) nearest = std::min(nearest, lambda);
      if (!is_high && is_below_band(lambda)) nearest = std::max(nearest, lambda);
    }
    if (nearest == old.lambda) continue;
    counter_->forget(old.lambda);
    const std::int64_t below = take(std::midpoint(nearest, is_high ? high_ : low_), kEdgeTolerance / 10).below;
    modes_.band_count -= std::abs(below - old.below);
    if (!is_high) modes_.count_below_low = below;
    has_moved = true;
  }
  return has_moved;
}

// Beyond it max_modes asks for nothing: the last mode wanted, or the end of the last slice while that is not found.
double BandSolver::find_end_of_search() const {
  if (!options_.max_modes || static_cast<std::int64_t>(found_.lambda.size()) < *options_.max_modes) return sought_to_;
  std::vector<double> sorted = found_.lambda;
  const auto last = sorted.begin() + (*options_.max_modes - 1);
  std::nth_element(sorted.begin(), last, sorted.end());
  return *last;
}

// Compares every count with the modes found; what is missing between two of them is sought there once more.
void BandSolver::prove() {
  move_doubtful_counts();
  for (int attempt = 0;; ++attempt) {
    const std::vector<Inertia> counts = sort_counts(counter_->get_taken());
    bool is_complete = true;
    for (std::size_t i = 1; i < counts.size(); ++i) {
      const Slice part{counts[i - 1].lambda, counts[i - 1].below, counts[i].lambda, counts[i].below};
      if (part.low >= find_end_of_search()) break;
      const std::int64_t found = count_found(part.low, part.high);
      if (found == part.count()) continue;
      is_complete = false;
      if (attempt > 0 || found > part.count()) {
        throw SolveError(
            fmt::format("Between {:.6g} and {:.6g} Hz the inertia of K - lambda M counts {} modes, and {} were found. Take a tighter "
                        "tolerance, solve the band in parts, or let MUMPS factorise.",
                        to_hz(part.low), to_hz(part.high), part.count(), found));
      }
      find_missing(part, std::midpoint(part.low, part.high));
    }
    if (is_complete && !move_counts_to_band()) return;
  }
}

void BandSolver::describe_proof() {
  Proof& proof = modes_.proof;
  std::vector<Inertia> counts = sort_counts(counter_->get_taken());
  // Where the shift had to go up for rounding, and nothing but the rigid modes lies below it, nothing else lies below the band either.
  const double asked = scaling_.to_scaled(find_ends(options_).low) * (1 - 2 * kEdgeNudge);
  if (counts.front().below == modes_.rigid_count) counts.front().lambda = std::min(counts.front().lambda, asked);
  for (const Inertia& taken : counts) proof.counts.push_back({to_hz(taken.lambda), taken.below, find_margin(taken.lambda)});
  proof.found = count_found(counts.front().lambda, counts.back().lambda);
  proof.factor_backward_error = counter_->get_worst_backward_error();
  proof.method = fmt::format("signs of the pivots of K - lambda M = L D L^T ({})", modes_.factor.solver);
}

// What of the modes, ascending, is in the band and wanted.
void BandSolver::check_range(std::vector<std::size_t>& order, const std::vector<double>& lambda) {
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return lambda[a] < lambda[b]; });
  std::erase_if(order, [&](std::size_t i) { return is_below_band(lambda[i]) || is_above_band(lambda[i]); });
  // The counts were taken a little outside the band.
  const auto within = static_cast<std::int64_t>(order.size());
  if (!options_.max_modes || within < std::min(modes_.band_count, *options_.max_modes)) modes_.band_count = within;
  // Of equal modes all are kept until their basis is made: part of a group would depend on how it was found.
  if (options_.max_modes && within > *options_.max_modes) {
    auto kept = static_cast<std::size_t>(*options_.max_modes);
    while (kept < order.size() && lambda[order[kept]] <= lambda[order[kept - 1]] * (1 + kSurelyApart)) ++kept;
    order.resize(kept);
  }
  for (const std::size_t i : order) modes_.lambda.push_back(lambda[i]);
  std::vector<char> is_taken(lambda.size(), 0);
  for (const std::size_t i : order) is_taken[i] = 1;
  for (std::size_t i = 0; i < lambda.size(); ++i)
    if (is_taken[i] == 0) others_.push_back(lambda[i]);
}

/// The counts stood where they were; refining may have moved the modes beside them by some digits.
void BandSolver::measure_margins() {
  for (Count& count : modes_.proof.counts) {
    const double cut = scaling_.to_scaled(std::pow(2 * std::numbers::pi * count.freq_hz, 2));
    count.margin = std::numeric_limits<double>::infinity();
    for (const std::vector<double>* lambdas : {&modes_.lambda, &others_})
      for (const double lambda : *lambdas) count.margin = std::min(count.margin, std::abs(lambda - cut) / cut);
  }
}

void BandSolver::take_found() {
  std::vector<std::size_t> order(found_.lambda.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  check_range(order, found_.lambda);
  modes_.shapes = found_.take(order);
}

void BandSolver::collect(const DensePairs& dense) {
  std::vector<std::size_t> order(dense.lambda.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  check_range(order, dense.lambda);
  if (order.empty()) return;
  PetscInt rows = 0;
  check(MatGetLocalSize(problem_.stiffness, &rows, nullptr));
  check(MatCreateDense(comm_, rows, PETSC_DECIDE, n_, petsc::to_petsc_int(static_cast<std::int64_t>(order.size())), nullptr,
                       modes_.shapes.out()));
  {
    const LocalColumns from(dense.vectors);
    const LocalColumns to(modes_.shapes);
    for (std::size_t j = 0; j < order.size(); ++j)
      std::copy_n(from.column(static_cast<PetscInt>(order[j])), from.rows, to.column(static_cast<PetscInt>(j)));
  }
  check(MatAssemblyBegin(modes_.shapes, MAT_FINAL_ASSEMBLY));
  check(MatAssemblyEnd(modes_.shapes, MAT_FINAL_ASSEMBLY));
}

RefineRequest BandSolver::make_refine_request(double tolerance) {
  RefineRequest request;
  request.operators = operators_.get();
  request.tolerance = tolerance;
  if (counter_ != nullptr) request.at_hand = counter_->find_standing();
  request.get_factor = [this]() -> ShiftedFactor& {
    if (counter_ == nullptr) make_counter();
    return counter_->get_factor();
  };
  request.turn_stable = [this] { return counter_->turn_to_mumps(); };
  return request;
}

/// The correction has a factor of its own, which is not the story of the solve; its work counts.
template <class Step>
void BandSolver::add_cost(Step&& step) {
  const FactorStatistics before = modes_.factor;
  const RefineCost cost = step();
  modes_.factor = before;
  modes_.factor.factorisations += cost.factorisations;
  modes_.factor.solves += cost.solves;
}

/// Modes whose residual is above the tolerance because of rounding alone are measured through the inverse.
void BandSolver::certify(ModeErrors& errors) {
  const RefineRequest request = make_refine_request(options_.tolerance);
  add_cost([&] { return certify_modes(request, modes_.lambda, modes_.shapes, errors); });
}

/// Until every residual is below `tolerance`, or no better can be had; throws where that is not within the tolerance of the options.
void BandSolver::refine(double tolerance, ModeErrors& errors) {
  const RefineRequest request = make_refine_request(tolerance);
  add_cost([&] { return refine_modes(request, modes_.lambda, modes_.shapes, errors); });
  for (std::size_t j = 0; j < errors.residual.size(); ++j) {
    if (is_accepted(errors, j, options_.tolerance)) continue;
    throw SolveError(
        fmt::format("Mode {} at {:.6g} Hz has the relative residual {:.2g}, above the tolerance {:.2g} and above what rounding "
                    "explains ({:.2g}). Take a looser tolerance, or correct the thinnest elements of the mesh.",
                    j, to_hz(modes_.lambda[j]), errors.residual[j], options_.tolerance, errors.floor[j]));
  }
}

// Equal modes past max_modes have served to make the basis of their group.
void BandSolver::drop_beyond_limit() {
  const std::int64_t limit = options_.max_modes.value_or(std::numeric_limits<PetscInt>::max());
  if (static_cast<std::int64_t>(modes_.lambda.size()) <= limit) return;
  modes_.lambda.resize(static_cast<std::size_t>(limit));
  modes_.residual.resize(static_cast<std::size_t>(limit));
  std::vector<Cluster>& clusters = modes_.proof.clusters;
  for (Cluster& cluster : clusters) cluster.count = std::min(cluster.count, limit - cluster.first);
  std::erase_if(clusters, [](const Cluster& cluster) { return cluster.count < 2; });
  petsc::MatHandle kept;
  Mat view = nullptr;
  check(MatDenseGetSubMatrix(modes_.shapes, PETSC_DECIDE, PETSC_DECIDE, 0, petsc::to_petsc_int(limit), &view));
  check(MatDuplicate(view, MAT_COPY_VALUES, kept.out()));
  check(MatDenseRestoreSubMatrix(modes_.shapes, &view));
  modes_.shapes = std::move(kept);
}

/// Of modes that are equal, or nearly, and measures all in it.
void BandSolver::choose_basis(ModeErrors& errors) {
  const std::vector<Cluster> groups = find_groups(modes_.lambda, errors, options_.tolerance);
  modes_.proof.clusters = split_groups(*operators_, groups, errors, modes_.lambda, modes_.shapes);
  if (groups.empty()) return;
  make_canonical(*operators_, problem_.nodes, modes_.proof.clusters, modes_.lambda, modes_.shapes);
  std::vector<double> quotients = modes_.lambda;
  errors = normalise_and_measure(*operators_, quotients, modes_.shapes);
}

void BandSolver::finish() {
  if (modes_.lambda.empty()) return;
  ModeErrors errors;
  refine(options_.tolerance, errors);
  certify(errors);
  choose_basis(errors);
  // In a basis of equal modes their residuals meet, and many that were within the tolerance may add up to one that is not.
  double aim = options_.tolerance;
  for (int i = 0; i < kBases; ++i) {
    double worst = 0;
    for (std::size_t j = 0; j < errors.residual.size(); ++j)
      worst = std::max(worst, errors.residual[j] / std::max(options_.tolerance, errors.floor[j]));
    if (worst <= 1) break;
    aim *= 0.5 / worst;
    refine(aim, errors);
    choose_basis(errors);
  }
  certify(errors);
  for (std::size_t j = 0; j < errors.residual.size(); ++j) {
    if (errors.residual[j] <= std::max(kWorstResidual, options_.tolerance)) continue;
    throw SolveError(fmt::format(
        "Mode {} at {:.6g} Hz is so slow beside the stiffest of the body that rounding leaves a relative residual of {:.2g} in it, "
        "more than {:g}. Let the band begin above it, or correct what is far stiffer than the rest: thin elements, or a material.",
        j, to_hz(modes_.lambda[j]), errors.residual[j], kWorstResidual));
  }
  counter_.reset();
  measure_margins();
  modes_.residual = errors.residual;
  modes_.orthonormality_error = errors.orthonormality;
  orient_shapes(modes_.shapes, problem_.nodes.position);
  drop_beyond_limit();
  modes_.above_tolerance_count =
      std::count_if(modes_.residual.begin(), modes_.residual.end(), [&](double residual) { return residual > options_.tolerance; });
  check(MatScale(modes_.shapes, scaling_.get_shape_factor()));
  for (double& lambda : modes_.lambda) lambda = scaling_.from_scaled(lambda);
}

}  // namespace

Modes solve_modes(const Problem& problem, const Options& options) {
  check_input(problem, options);
  if (options.checkpoint != nullptr) {
    if (std::optional<Modes> known = load_modes(problem.stiffness, *options.checkpoint)) return std::move(*known);
  }
  return BandSolver(problem, options).solve();
}

}  // namespace carillon::eigen
