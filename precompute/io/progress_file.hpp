// How far a run is, in a file that others read while it runs.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <mutex>
#include <string>
#include <thread>

#include "precompute/eigen/solve_modes.hpp"
#include "precompute/io/costs.hpp"
#include "precompute/io/run_estimate.hpp"

namespace carillon::io {

/// Appends lines of JSON: {"phase": "factor", "percent": 31.4, "modes_done": 0, "modes_wanted": 228, "seconds_left": 8.1, "seconds": 3.7}.
/// A line at every phase, and every half second in between while anything moves. percent is of the whole run and never falls; the last line
/// has the phase "done" and 100. What is not known yet ("modes_wanted", "seconds_left") is left out. A thread of its own writes the lines
/// in between. Used on rank 0 only.
class ProgressFile {
 public:
  /// Throws InputError when the file is no regular file or character device, or cannot be appended to.
  ProgressFile(const std::filesystem::path& file, int ranks);
  ~ProgressFile();
  ProgressFile(const ProgressFile&) = delete;
  ProgressFile& operator=(const ProgressFile&) = delete;

  /// A station of the run begins.
  void begin(const std::string& station);
  /// What is known of the body by now.
  void learn(const Extent& extent);
  /// The solver has got so far.
  void advance(const eigen::Progress& progress);
  /// The last line.
  void finish();
  /// The settings that are tried for "accuracy_cents" before the last one; how many is not known beforehand.
  void expect_trials();

 private:
  double find_seconds() const;
  void write_line();
  void run();

  int file_ = -1;
  std::chrono::steady_clock::time_point start_;
  std::mutex mutex_;  // of all below
  RunEstimate estimate_;
  std::string phase_;
  std::string last_;  // line, without its seconds
  bool is_broken_ = false;
  bool is_over_ = false;
  std::condition_variable over_;
  std::thread writer_;
};

}  // namespace carillon::io
