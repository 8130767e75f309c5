// Method: Block Lanczos with a shift inside each slice finds its modes; missing copies of repeated eigenvalues are searched again with all
// found modes deflated. Modes still missing between two counts are then searched with a shift between these.
// Source: Grimes, Lewis, Simon, A shifted block Lanczos algorithm, SIAM J. Matrix Anal. Appl. 15(1), 1994 (counts and slices). Block
// Lanczos: block_lanczos.cpp.
#include "precompute/eigen/search.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "precompute/eigen/memory.hpp"
#include "precompute/eigen/predict_cost.hpp"
#include "precompute/eigen/proof.hpp"
#include "precompute/eigen/timer.hpp"
#include "precompute/la/local_columns.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::eigen {
namespace {

constexpr double kEdge = BandLimits::kTolerance;
constexpr int kMaxRounds = 60;       // Maximum Krylov runs per interval,
constexpr int kMaxIdleRounds = 2;    // and without a new mode.
constexpr double kBelowBand = 1e-2;  // Relative to a lower end that was not counted: modes down to here are searched as well.
constexpr double kLockedMargin = 1;  // Modes found within this distance of a slice, in widths of the slice, are locked.
constexpr double kKrylovTolerance =
    0.1;  // Relative to the tolerance: Ritz residuals of the inverse omit the amplification of high frequencies by K.

}  // namespace

void ProgressReport::operator()(Phase phase, std::int64_t modes_done, std::int64_t more_solves) const {
  const Options& options = body.options;
  if (!options.progress || !body.comm.is_root()) return;
  options.progress({phase, modes_done, std::min(band_count, options.max_modes.value_or(band_count)), factor.flops, factor.entries,
                    factor.factorisations, factor.solves + more_solves});
}

Search::Search(const BandProblem& body, const ProgressReport& report, FactorStatistics& factor, Seconds& seconds)
    : body_(body),
      report_(report),
      factor_(factor),
      seconds_(seconds),
      checkpoint_(body.comm, body.options.checkpoint, {&found_, &factor, nullptr}),
      counter_(body.pencil, body.problem, body.options, body.rigid, seconds, factor,
               [&body](double lambda) { return body.to_hz(lambda); }) {
  checkpoint_.load(body.n, body.scaling.get_powers());
  checkpoint_.set_counter(&counter_);
}

Inertia Search::count_below(double lambda, double reach, ShiftRule rule) {
  SearchStep step;
  step.asked = {lambda, reach, rule == ShiftRule::kMayMoveUp ? 1.0 : 0.0};
  if (const SearchStep* known = checkpoint_.replay(step)) {
    const Inertia count{known->answer[0], static_cast<std::int64_t>(known->answer[1])};
    counter_.restore(count);
    return count;
  }
  const Inertia count = counter_.count_below(lambda, reach, rule);
  step.answer = {count.lambda, static_cast<double>(count.below)};
  checkpoint_.record(step);
  return count;
}

BandCounter Search::get_band_counter() {
  return {[this](double lambda, double reach, ShiftRule rule) { return count_below(lambda, reach, rule); },
          [this](double lambda) { forget(lambda); }};
}

Slice Search::cut_to_wanted(const Slice& band) {
  if (!body_.options.max_modes) return band;
  const double expected = body_.scaling.to_scaled(std::pow(2 * std::numbers::pi * body_.options.expected_hz, 2));
  return cut_to_lowest(band, *body_.options.max_modes, expected, [this](double lambda) { return count_below(lambda).below; });
}

KrylovRequest Search::make_request(const Slice& slice, double sigma, Missing missing, int round) const {
  KrylovRequest request;
  request.pencil = body_.pencil;
  request.mass_blocks = &body_.operators.mass;
  request.sigma = sigma;
  request.low = slice.low * (counts_->is_low_assumed ? kBelowBand : 1 - kEdge);
  request.high = slice.high * (1 + kEdge);
  request.count = petsc::to_petsc_int(missing.count);
  request.is_count_known = missing.is_known;
  // Modes below the slice are nearer to the shift than its upper end if it starts at the bottom. Copies that appear only through rounding
  // converge late: later runs request some more, beyond the slice.
  const bool is_below = sigma - slice.low * 0.5 > slice.high - sigma || sigma < slice.low;
  const std::int64_t below = slice.below_low - body_.rigid_count();
  request.nearest = petsc::to_petsc_int(missing.count + (is_below || 5 * below <= slice.count() ? below : 0) + std::min(round, 4) * 10);
  request.method = body_.options.method;
  request.tolerance = kKrylovTolerance * body_.options.tolerance;
  request.nodes_m = &body_.problem.nodes.nodes_m;
  request.round = round;
  request.max_steps = body_.options.max_steps;
  // Vectors far from the slice are orthogonal to it by their residuals; those in it or near its ends must be locked. Fewer locked
  // neighbours make the iteration cheaper.
  request.locked_above = slice.low - kLockedMargin * (slice.high - slice.low);
  return request;
}

// One Krylov run; adds new modes of the slice. Returns the lambda up to which, from sigma on, it left nothing out.
double Search::run_round(const Slice& slice, double sigma, Missing missing, int round) {
  SearchStep step;
  step.kind = SearchStep::kRound;
  step.asked = {sigma, slice.low, slice.high, static_cast<double>(missing.count), round + (missing.is_known ? 0.0 : 0.5)};
  if (const SearchStep* known = checkpoint_.replay(step)) {
    checkpoint_.restore_found(*known);
    return known->answer[0];
  }
  ShiftedFactor& factor = counter_.factor_at(sigma);
  const Timer timer(seconds_.iterate);
  KrylovRequest request = make_request(slice, sigma, missing, round);
  request.factor = &factor;
  const std::int64_t before = count();
  request.progress = [&](std::int64_t converged, std::int64_t solves) { report_(Phase::kIterate, before + converged, solves); };
  request.checkpoint = checkpoint_.begin_round(step);
  const KrylovStatistics statistics = run_krylov(request, found_);
  factor_.solves += statistics.solves;
  seconds_.solve += statistics.solve_seconds;
  checkpoint_.end_round();
  step.answer = {statistics.solved_to};
  checkpoint_.record(step);
  return statistics.solved_to;
}

// Called after the first run, whose slice starts at the lower end of the band. If the modes found up to the shift equal the count there
// less the rigid modes, those found below the band are all there are; otherwise the lower end is counted.
void Search::settle_low_end(Slice& slice, const Inertia& shift) {
  const std::int64_t found = count_found(found_.lambda, kBelowBand * slice.low, shift.lambda);
  const double margin = std::min(find_margin(found_.lambda, shift.lambda), find_margin(found_.lambda, slice.low));
  if (shift.below - found == slice.below_low && margin >= kSafeMargin) {
    slice.below_low += count_found(found_.lambda, kBelowBand * slice.low, slice.low);
    counter_.restore({slice.low, slice.below_low});
    counts_->band.below_low = counts_->count_below_low = slice.below_low;
    counts_->band_count = counts_->band.count();
    counts_->is_low_assumed = false;
    counts_->is_low_derived = true;
    return;
  }
  count_low_end(body_, get_band_counter(), *counts_);
  slice.low = counts_->band.low;
  slice.below_low = counts_->band.below_low;
}

// Runs with the factor at sigma until the slice is complete by count, or runs find nothing new.
void Search::run_rounds(Slice slice, double sigma, int first) {
  int idle = 0;
  const auto find_shift = [&] {
    return *std::find_if(counts().begin(), counts().end(), [&](const Inertia& c) { return c.lambda == sigma; });
  };
  for (int round = first; round < kMaxRounds && idle < kMaxIdleRounds; ++round) {
    const std::int64_t missing = slice.count() - count_found(found_.lambda, slice.low * (1 - kEdge), slice.high * (1 + kEdge));
    if (missing <= 0) break;
    const std::int64_t before = count();
    run_round(slice, sigma, {missing, true}, round);
    if (counts_->is_low_assumed) settle_low_end(slice, find_shift());
    idle = count() > before ? 0 : idle + 1;
  }
}

// Runs around sigma until the slice is complete by count.
void Search::find_missing(const Slice& slice, double sigma) {
  report_(Phase::kFactor, count());
  run_rounds(slice, count_below(sigma, 1e-5).lambda, 0);
}

void Search::run(BandCounts& counts) {
  counts_ = &counts;
  Slice wanted = cut_to_wanted(counts.band);
  searched_to_ = wanted.high;
  check_memory(body_.comm, calc_search_bytes(body_.rows, wanted.count(), body_.rigid_count()), body_.options.memory_limit_bytes,
               fmt::format("The search for {} modes", wanted.count()));
  found_.reset(body_.problem.stiffness, petsc::to_petsc_int(wanted.count()), body_.rigid);
  checkpoint_.load_found();
  Sweep sweep(wanted, kSliceModes, [this](double lambda) {
    report_(Phase::kFactor, count());
    return count_below(lambda).below;
  });
  Slice counted = wanted;  // between shifts, where counts are exact
  while (!sweep.is_last()) {
    const Sweep::Part part = sweep.take();
    counted.high = part.sigma;
    counted.below_high = part.below_sigma;
    const double solved_to = run_round(part.slice, part.sigma, {part.slice.count(), false}, 0);
    if (counts.is_low_assumed) {
      settle_low_end(counted, {part.sigma, part.below_sigma});
      wanted.low = counted.low;
      wanted.below_low = counted.below_low;
    }
    if (count_found(found_.lambda, counted.low, counted.high) >= counted.count()) {
      sweep.advance(solved_to, wanted.below_low + count_found(found_.lambda, wanted.low * (1 - kEdge), solved_to));
    } else {
      // Copies are missing below the shift, and probably above. If left for later they would count as modes of later slices.
      run_rounds(counted, part.sigma, 1);
      sweep.advance(part.sigma, part.below_sigma);
    }
    counted.low = part.sigma;
    counted.below_low = part.below_sigma;
  }
  const Slice& rest = sweep.get_rest();
  if (rest.count() > 0) find_missing(rest, std::midpoint(rest.low, rest.high));
}

double Search::find_end() const { return find_end_of_search(found_.lambda, body_.options.max_modes, searched_to_); }

void Search::move_doubtful_counts(const BandLimits& limits) {
  const std::vector<Inertia> counts = counter_.counts();
  for (const Inertia& old : counts) {
    const std::optional<double> shift = find_safer_shift(found_.lambda, old.lambda, limits);
    if (!shift) continue;
    counter_.forget(old.lambda);
    (void)count_below(*shift);
  }
}

// Searches gaps between counts once more. True if there were none.
bool Search::search_gaps() {
  const std::vector<Inertia> counts = sort_counts(counter_.counts());
  bool is_complete = true;
  for (std::size_t i = 1; i < counts.size() && counts[i - 1].lambda < find_end(); ++i) {
    const Slice part{counts[i - 1].lambda, counts[i - 1].below, counts[i].lambda, counts[i].below};
    const std::int64_t found = count_found(found_.lambda, part.low, part.high);
    if (found == part.count()) continue;
    if (found > part.count()) verify_found();
    is_complete = false;
    find_missing(part, std::midpoint(part.low, part.high));
  }
  return is_complete;
}

// A mode between an end of the band and its count is counted but outside the band: repeats the count between them. True if there was one.
bool Search::move_counts_to_band(BandCounts& counts) {
  const BandLimits& limits = counts.limits;
  bool has_moved = false;
  for (const bool is_high : {false, true}) {
    const std::vector<Inertia> sorted = sort_counts(counter_.counts());
    const Inertia old = is_high ? sorted.back() : sorted.front();
    const double nearest = find_mode_outside(found_.lambda, old.lambda, limits, is_high);
    if (nearest == old.lambda) continue;
    counter_.forget(old.lambda);
    const std::int64_t below = count_below(std::midpoint(nearest, is_high ? limits.high : limits.low), kEdge / 10).below;
    counts.band_count -= std::abs(below - old.below);
    if (!is_high) counts.count_below_low = below;
    has_moved = true;
  }
  return has_moved;
}

void Search::verify_found() const {
  verify(counter_.counts(), found_.lambda, find_end(), [this](double lambda) { return body_.to_hz(lambda); });
}

void Search::complete(BandCounts& counts) {
  move_doubtful_counts(counts.limits);
  for (bool is_complete = search_gaps(); !is_complete || move_counts_to_band(counts); is_complete = true) verify_found();
}

BandCounts Search::continue_from(const Modes& known) {
  BandCounts counts;
  counts_ = &counts;
  for (const Count& count : known.proof.counts)
    counter_.restore({body_.scaling.to_scaled(std::pow(2 * std::numbers::pi * count.freq_hz, 2)), count.below});
  const std::vector<Inertia> before = sort_counts(counter_.counts());
  const auto take = get_band_counter().count_below;
  const Inertia above = before.back().lambda < body_.asked.high ? count_below_high(take, body_.asked.high) : before.back();
  Inertia below = before.front();
  if (below.lambda > body_.asked.low)  // rounding may move the count up
    if (const Inertia lower = count_below_low(take, body_.asked.low); lower.lambda < below.lambda) below = lower;
  counts.limits = {std::max(below.lambda, body_.asked.low), body_.asked.high};
  counts.band = {below.lambda, below.below, above.lambda, above.below};
  counts.count_below_low = below.below;
  counts.mechanism_count = known.mechanism_count;
  counts.band_count = counts.band.count();
  searched_to_ = above.lambda;
  check_memory(body_.comm, calc_search_bytes(body_.rows, counts.band_count, body_.rigid_count()), body_.options.memory_limit_bytes,
               fmt::format("The search for {} modes", counts.band_count));
  found_.reset(body_.problem.stiffness, petsc::to_petsc_int(counts.band_count), body_.rigid);
  const la::LocalColumns shapes(known.shapes);
  std::vector<double> shape(shapes.rows);
  for (std::size_t j = 0; j < known.lambda.size(); ++j) {
    std::transform(shapes.column(static_cast<PetscInt>(j)), shapes.column(static_cast<PetscInt>(j)) + shapes.rows, shape.begin(),
                   [factor = body_.scaling.get_shape_factor()](double value) { return value / factor; });
    found_.add(body_.scaling.to_scaled(known.lambda[j]), shape.data());
  }
  return counts;
}

}  // namespace carillon::eigen
