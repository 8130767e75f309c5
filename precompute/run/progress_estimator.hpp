// The share of a run that is done, from the predicted costs of its parts and the time they really took.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "precompute/job/cost/seconds.hpp"
#include "precompute/eigen/solve_modes.hpp"

namespace carillon::run {

/// Reads no clock: every call passes how many seconds the run has taken.
class ProgressEstimator {
 public:
  explicit ProgressEstimator(int ranks) : ranks_(ranks) {}

  /// From now on trials may follow, of unknown number.
  void begin_trials() { is_trial_ = true; }
  /// A phase of RunLog begins ("read", "partition", "assemble", "modes", "errors", "collect", "write").
  void begin(const std::string& phase, double seconds);
  void set_size(const cost::ProblemSize& size);
  void advance(const eigen::Progress& progress, double seconds);
  void finish() { is_done_ = true; }

  /// Never less than at an earlier call; 100 only after finish().
  double calc_percent(double seconds);
  /// Of wall clock. Empty while it is not known: before the mesh is known, and while trials may follow.
  std::optional<double> calc_seconds_left(double seconds) const;

  std::int64_t get_modes_done() const { return progress_.modes_done; }
  std::int64_t get_modes_wanted() const { return progress_.modes_wanted; }

 private:
  struct Share {
    double done = 0;
    double left = 0;
  };
  double calc_modes_done() const;
  double calc_step() const;
  Share calc_share(double seconds) const;

  int ranks_ = 1;
  bool is_trial_ = false;  // others may follow
  bool is_done_ = false;
  cost::ProblemSize size_;
  cost::PhaseSeconds costs_;
  bool knows_size_ = false;
  int phase_ = -1;
  double begun_s_ = 0;  // the phase, or the last step within it
  eigen::Progress progress_;
  double start_s_ = 0;  // of the trial at hand
  double start_percent_ = 0;
  double percent_ = 0;
};

}  // namespace carillon::run
