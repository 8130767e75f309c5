#include "precompute/run/progress_reporter.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "precompute/run/phase_names.hpp"
#include "precompute/run/worker.hpp"

namespace carillon::run {

ProgressReporter::ProgressReporter(const std::filesystem::path& file, int ranks)
    : file_(file), start_(std::chrono::steady_clock::now()), estimator_(ranks) {
  writer_ = start_worker([this] { write_periodically(); });
}

ProgressReporter::~ProgressReporter() {
  {
    const std::lock_guard lock(mutex_);
    is_over_ = true;
  }
  over_.notify_all();
  writer_.join();
}

double ProgressReporter::find_seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

void ProgressReporter::begin(const std::string& phase) {
  const std::lock_guard lock(mutex_);
  phase_ = phase;
  estimator_.begin(phase, find_seconds());
  if (phase != "modes") write_line();  // it begins with a phase of the eigensolver
}

void ProgressReporter::set_size(const cost::ProblemSize& size) {
  const std::lock_guard lock(mutex_);
  estimator_.set_size(size);
}

void ProgressReporter::begin_trials() {
  const std::lock_guard lock(mutex_);
  estimator_.begin_trials();
}

void ProgressReporter::advance(const eigen::Progress& progress) {
  const std::lock_guard lock(mutex_);
  const bool is_new = phase_ != get_key(progress.phase);
  phase_ = get_key(progress.phase);
  estimator_.advance(progress, find_seconds());
  if (is_new) write_line();
}

void ProgressReporter::finish() {
  const std::lock_guard lock(mutex_);
  phase_ = "done";
  estimator_.finish();
  write_line();
}

/// A full disk must not end the run.
void ProgressReporter::write_line() {
  io::ProgressLine line;
  line.seconds = find_seconds();
  line.phase = phase_;
  line.percent = estimator_.calc_percent(line.seconds);
  line.modes_done = std::min(estimator_.get_modes_done(), estimator_.get_modes_wanted());
  if (estimator_.get_modes_wanted() > 0) line.modes_wanted = estimator_.get_modes_wanted();
  line.seconds_left = estimator_.calc_seconds_left(line.seconds);
  if (!file_.append(line))
    fmt::print(stderr, "carillon-precompute: warning: the progress file takes no more lines: {}\n", std::strerror(errno));
}

void ProgressReporter::write_periodically() {
  constexpr auto kInterval = std::chrono::milliseconds(500);
  std::unique_lock lock(mutex_);
  while (!over_.wait_for(lock, kInterval, [this] { return is_over_; })) {
    if (phase_ != "done" && !phase_.empty()) write_line();
  }
}

}  // namespace carillon::run
