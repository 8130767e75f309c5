// Output of `carillon run`: text, on a terminal with a progress bar, or JSON lines.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "jobs/store/registry/job_table.hpp"
#include "jobs/store/warning_kinds.hpp"

namespace carillon::queue {

/// Writes complete lines to standard output. On a terminal the last line may be the progress bar, which is cleared before any other line
/// and at the end. Text output shows the first warning of each kind, and counts at the end.
class Display {
 public:
  using ReadProgress = std::function<std::optional<store::Progress>(const store::Id&)>;
  using FindWarnings = std::function<std::vector<std::string>(const registry::Job&)>;
  Display(bool json, bool quiet, ReadProgress read_progress);
  ~Display();

  /// Sets the source of warnings of finished jobs; without it none are shown.
  void show_warnings_by(FindWarnings find_warnings) { find_warnings_ = std::move(find_warnings); }

  /// One line about a job. `event`: "start", "predict", "adopt", "done", "failed", "cancelled", "waiting", "queued".
  void print_event(const std::string& event, const registry::Job& job);
  /// One line about the whole run.
  void print_note(const std::string& text);
  /// Updates the bar, or prints a line for each job with progress.
  void show(const std::vector<registry::Job>& jobs);

 private:
  void clear();
  void print(const std::string& line);

  const ReadProgress read_progress_;
  FindWarnings find_warnings_;
  bool json_ = false, quiet_ = false, is_terminal_ = false;
  bool has_bar_ = false;
  store::WarningKinds kinds_;
  bool has_repeated_ = false;  // a kind of warning occurred again
  std::map<std::string, double> shown_percent_;
  std::size_t ended_ = 0;
};

}  // namespace carillon::queue
