// Reports the progress of a run to the file of --progress.
#pragma once

#include <chrono>
#include <condition_variable>
#include <filesystem>
#include <mutex>
#include <string>
#include <thread>

#include "precompute/eigen/solve_modes.hpp"
#include "precompute/run/io/progress_file.hpp"
#include "precompute/run/progress_estimator.hpp"

namespace carillon::run {

/// Writes a line at every phase, and every half second in between if anything has changed: those by a thread of its own. The percentage is
/// of the whole run and never falls; the last line has the phase "done" and 100. On rank 0 only.
class ProgressReporter {
 public:
  /// Throws InputError as io::ProgressFile.
  ProgressReporter(const std::filesystem::path& file, int ranks);
  ~ProgressReporter();
  ProgressReporter(const ProgressReporter&) = delete;
  ProgressReporter& operator=(const ProgressReporter&) = delete;

  /// A phase of the run begins.
  void begin(const std::string& phase);
  /// What is known of the problem by now.
  void set_size(const cost::ProblemSize& size);
  /// The state of the eigensolver.
  void advance(const eigen::Progress& progress);
  /// Writes the last line.
  void finish();
  /// Trials of settings for "accuracy_cents" follow; their number is unknown.
  void begin_trials();

 private:
  double find_seconds() const;
  void write_line();
  void write_periodically();

  io::ProgressFile file_;
  std::chrono::steady_clock::time_point start_;
  std::mutex mutex_;  // of all below, and of file_
  ProgressEstimator estimator_;
  std::string phase_;
  bool is_over_ = false;
  std::condition_variable over_;
  std::thread writer_;
};

}  // namespace carillon::run
