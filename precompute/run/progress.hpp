// Progress of a run for the file of --progress: its phase, and the modes found of those counted.
#pragma once

#include <chrono>
#include <filesystem>
#include <string>

#include "precompute/eigen/types.hpp"
#include "precompute/run/io/progress_file.hpp"

namespace carillon::run {

/// "24 of 228 modes", "factorising K - sigma M": for the log.
std::string describe(const eigen::Progress& progress);

/// Writes a line at every phase and every step of the eigensolver. The percentage has a fixed share for each phase; within the search it
/// follows the right-hand sides. It never decreases. Rank 0 only.
class ProgressReporter {
 public:
  /// Throws InputError as io::ProgressFile.
  explicit ProgressReporter(const std::filesystem::path& file);

  /// A phase of RunLog begins.
  void begin(const std::string& phase);
  /// A step of the eigensolver.
  void advance(const eigen::Progress& progress);
  /// The run is complete.
  void finish();

 private:
  void write_line(const std::string& phase, double share);

  io::ProgressFile file_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  io::ProgressLine line_;
  double begin_percent_ = 0.0;  // of the current setting, where "accuracy_cents" tries several
};

}  // namespace carillon::run
