// Search for the modes of a band.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/eigen/band.hpp"
#include "precompute/eigen/inertia.hpp"
#include "precompute/eigen/krylov.hpp"
#include "precompute/eigen/search_checkpoint.hpp"
#include "precompute/eigen/slices.hpp"
#include "precompute/eigen/types.hpp"

namespace carillon::eigen {

/// Reports progress on rank 0, if the options have a callback.
struct ProgressReport {
  const BandProblem& body;
  const FactorStatistics& factor;
  std::int64_t band_count = 0;  // modes in the band; 0 until counted

  void operator()(Phase phase, std::int64_t modes_done, std::int64_t more_solves = 0) const;
};

/// Keeps the factor of the last shift, all counts, and the modes found so far, M-orthonormal; with a checkpoint, records counts and modes,
/// so that a resumed search replays them. Every member is collective and throws Stopped on a stop request.
class Search {
 public:
  /// All arguments must outlive it. Reads the record of the checkpoint.
  Search(const BandProblem& body, const ProgressReport& report, FactorStatistics& factor, Seconds& seconds);

  /// The count, or its recorded value. See InertiaCounter.
  Inertia count_below(double lambda, double reach = 1e-6, ShiftRule rule = ShiftRule::kExact);
  void forget(double lambda) { counter_.forget(lambda); }
  InertiaCounter& counter() { return counter_; }

  /// count_below() and forget() of this search.
  BandCounter get_band_counter();

  /// Searches the part of the band with the wanted modes, slice by slice. Missing copies of repeated eigenvalues are left to complete(). An
  /// assumed lower end is proven by the first shift, or else counted; `counts` is updated.
  void run(BandCounts& counts);
  /// Continues until every count agrees with the modes found: repeats counts on a mode elsewhere, and searches gaps between two counts once
  /// more. Moves counts at the ends towards the band if a mode lies between; `counts` is updated. Throws SolveError if a gap remains.
  void complete(BandCounts& counts);
  /// In place of run(): takes over the modes and counts of a narrower band, and counts at the ends of this one that lie outside it.
  /// complete() then searches the modes between.
  BandCounts continue_from(const Modes& known);

  const std::vector<Inertia>& counts() const { return counter_.counts(); }
  double get_worst_backward_error() const { return counter_.get_worst_backward_error(); }
  FoundModes& found() { return found_; }

 private:
  struct Missing {
    std::int64_t count = 0;
    bool is_known = true;  // by inertia; otherwise a guess
  };
  double run_round(const Slice& slice, double sigma, Missing missing, int round);
  KrylovRequest make_request(const Slice& slice, double sigma, Missing missing, int round) const;
  Slice cut_to_wanted(const Slice& band);
  void run_rounds(Slice slice, double sigma, int first);
  void settle_low_end(Slice& slice, const Inertia& shift);
  void find_missing(const Slice& slice, double sigma);
  void move_doubtful_counts(const BandLimits& limits);
  bool search_gaps();
  bool move_counts_to_band(BandCounts& counts);
  void verify_found() const;
  double find_end() const;
  std::int64_t count() const { return static_cast<std::int64_t>(found_.lambda.size()); }

  const BandProblem& body_;
  const ProgressReport& report_;
  FactorStatistics& factor_;
  Seconds& seconds_;
  FoundModes found_;
  SearchCheckpoint checkpoint_;
  InertiaCounter counter_;
  double searched_to_ = 0;        // end of the last slice
  BandCounts* counts_ = nullptr;  // argument of run() and complete()
};

}  // namespace carillon::eigen
