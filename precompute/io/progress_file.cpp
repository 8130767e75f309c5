#include "precompute/io/progress_file.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>

#include "precompute/io/worker.hpp"
#include "runtime/base/error.hpp"

namespace carillon::io {
namespace {

constexpr auto kInterval = std::chrono::milliseconds(500);

int open_to_append(const std::filesystem::path& file) {
  const auto refuse = [&](const char* why) -> InputError {
    return InputError(fmt::format("{}: the progress file cannot be written: {}; give another with --progress", file.string(), why));
  };
  // A pipe without a reader would keep a plain open() waiting.
  // A name without a folder is a file of this folder: somebody else may have put a link there.
  const int own = file.has_parent_path() ? 0 : O_NOFOLLOW;
  const int handle = open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC | O_NONBLOCK | O_NOCTTY | own, 0666);
  if (handle < 0) throw refuse(std::strerror(errno));
  struct stat kind {};
  if (fstat(handle, &kind) == 0 && (S_ISREG(kind.st_mode) || S_ISCHR(kind.st_mode))) return handle;
  close(handle);
  throw refuse("it is no regular file");
}

const char* name_phase(eigen::Phase phase) {
  switch (phase) {
    case eigen::Phase::kRigid:
      return "rigid";
    case eigen::Phase::kAnalyse:
      return "analyse";
    case eigen::Phase::kCount:
      return "count";
    case eigen::Phase::kFactor:
      return "factor";
    case eigen::Phase::kIterate:
      return "iterate";
    case eigen::Phase::kCheck:
      return "check";
  }
  return "";
}

}  // namespace

ProgressFile::ProgressFile(const std::filesystem::path& file, int ranks)
    : file_(open_to_append(file)), start_(std::chrono::steady_clock::now()), estimate_(ranks) {
  writer_ = start_worker([this] { run(); });
}

ProgressFile::~ProgressFile() {
  {
    const std::lock_guard lock(mutex_);
    is_over_ = true;
  }
  over_.notify_all();
  writer_.join();
  close(file_);
}

double ProgressFile::find_seconds() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count(); }

void ProgressFile::begin(const std::string& station) {
  const std::lock_guard lock(mutex_);
  phase_ = station;
  estimate_.begin(station, find_seconds());
  if (station != "modes") write_line();  // which begins with a phase of the solver's
}

void ProgressFile::learn(const Extent& extent) {
  const std::lock_guard lock(mutex_);
  estimate_.learn(extent);
}

void ProgressFile::expect_trials() {
  const std::lock_guard lock(mutex_);
  estimate_.expect_trials();
}

void ProgressFile::advance(const eigen::Progress& progress) {
  const std::lock_guard lock(mutex_);
  const bool is_new = phase_ != name_phase(progress.phase);
  phase_ = name_phase(progress.phase);
  estimate_.advance(progress, find_seconds());
  if (is_new) write_line();
}

void ProgressFile::finish() {
  const std::lock_guard lock(mutex_);
  phase_ = "done";
  estimate_.finish();
  write_line();
}

/// What does not move is not said again. A disk that is full must not end the run.
void ProgressFile::write_line() {
  const double seconds = find_seconds();
  std::string text = fmt::format("{{\"phase\": \"{}\", \"percent\": {:.2f}, \"modes_done\": {}", phase_, estimate_.calc_percent(seconds),
                                 std::min(estimate_.get_modes_done(), estimate_.get_modes_wanted()));
  if (estimate_.get_modes_wanted() > 0) text += fmt::format(", \"modes_wanted\": {}", estimate_.get_modes_wanted());
  if (text == last_ || is_broken_) return;
  last_ = text;
  if (const auto left = estimate_.calc_seconds_left(seconds)) text += fmt::format(", \"seconds_left\": {:.1f}", *left);
  text += fmt::format(", \"seconds\": {:.2f}}}\n", seconds);
  if (write(file_, text.data(), text.size()) == static_cast<ssize_t>(text.size())) return;
  is_broken_ = true;
  fmt::print(stderr, "carillon-precompute: warning: the progress file takes no more lines: {}\n", std::strerror(errno));
}

void ProgressFile::run() {
  std::unique_lock lock(mutex_);
  while (!over_.wait_for(lock, kInterval, [this] { return is_over_; })) {
    if (phase_ != "done" && !phase_.empty()) write_line();
  }
}

}  // namespace carillon::io
