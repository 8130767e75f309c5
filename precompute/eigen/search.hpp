// The search for the modes of a band.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "precompute/eigen/band.hpp"
#include "precompute/eigen/inertia.hpp"
#include "precompute/eigen/krylov.hpp"
#include "precompute/eigen/search_checkpoint.hpp"
#include "precompute/eigen/slices.hpp"
#include "precompute/eigen/types.hpp"

namespace carillon::eigen {

/// Says how far a solve is; on the first rank, and where the options ask for it.
struct ProgressReport {
  const BandProblem& body;
  const FactorStatistics& factor;
  std::int64_t band_count = 0;  // modes in the band; 0 until they are counted

  void operator()(Phase phase, std::int64_t modes_done, std::int64_t more_solves = 0) const;
};

/// Keeps the factor of the last shift, every count, and the modes found so far, M-orthonormal; with a checkpoint it keeps a record of both,
/// so that a resumed search replays it. Every member is collective and throws Stopped where the checkpoint asks for it.
class Search {
 public:
  /// All must outlive it. The checkpoint's record is read here.
  Search(const BandProblem& body, const ProgressReport& report, FactorStatistics& factor, Seconds& seconds);

  /// The count, or what is recorded of it. See InertiaCounter.
  Inertia count_below(double lambda, double reach = 1e-6, ShiftRule rule = ShiftRule::kExact);
  void forget(double lambda) { counter_.forget(lambda); }
  InertiaCounter& counter() { return counter_; }

  /// Both of this search.
  BandCounter get_band_counter();

  /// Goes through the part of the band that holds the modes wanted, slice by slice. Copies of repeated eigenvalues that stay hidden are
  /// left to complete(). Where the lower end was assumed it is proven by the first shift, or else counted, and `counts` changes with it.
  void run(BandCounts& counts);
  /// Until every count agrees with the modes found: counts on a mode are taken again elsewhere, gaps between two counts are searched once
  /// more. Counts of the ends move to the band where a mode lies between, and `counts` with them. Throws SolveError where a gap stays.
  void complete(BandCounts& counts);

  const std::vector<Inertia>& counts() const { return counter_.counts(); }
  double get_worst_backward_error() const { return counter_.get_worst_backward_error(); }
  FoundModes& found() { return found_; }

 private:
  struct Missing {
    std::int64_t count = 0;
    bool is_known = true;  // by inertia, or guessed
  };
  double run_round(const Slice& slice, ShiftedFactor* cholmod, double sigma, Missing missing, int round);
  KrylovRequest make_request(const Slice& slice, double sigma, Missing missing, int round) const;
  Slice cut_to_wanted(const Slice& band);
  void run_rounds(Slice slice, ShiftedFactor* cholmod, double sigma, int first);
  void settle_low_end(Slice& slice, const Inertia& shift);
  void find_missing(const Slice& slice, double sigma);
  std::unique_ptr<ShiftedFactor> factorise_with_cholmod(double sigma);
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
  double searched_to_ = 0;        // the end of the last slice
  BandCounts* counts_ = nullptr;  // of run() and complete()
};

}  // namespace carillon::eigen
