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

/// Writes to the standard output alone, whole lines at a time. On a terminal the last line may be the bar; it is cleared before any other
/// line, and at the end. In text, one warning of each kind is shown at its first job; all are counted at the end.
class Display {
 public:
  using ReadProgress = std::function<std::optional<store::Progress>(const store::Id&)>;
  using FindWarnings = std::function<std::vector<std::string>(const registry::Job&)>;
  Display(bool json, bool quiet, ReadProgress read_progress);
  ~Display();

  /// Where the warnings of a job that is done come from; without this none are shown.
  void show_warnings_by(FindWarnings find_warnings) { find_warnings_ = std::move(find_warnings); }

  /// A job was started, ended, or waits: one line. `event`: "start", "predict", "adopt", "done", "failed", "cancelled", "waiting",
  /// "queued".
  void print_event(const std::string& event, const registry::Job& job);
  /// Something about the whole run: one line.
  void print_note(const std::string& text);
  /// How far everything is: the bar, or a line for each job that got further.
  void show(const std::vector<registry::Job>& jobs);

 private:
  void clear();
  void print(const std::string& line);

  const ReadProgress read_progress_;
  FindWarnings find_warnings_;
  bool json_ = false, quiet_ = false, is_terminal_ = false;
  bool has_bar_ = false;
  store::WarningKinds kinds_;
  bool has_repeated_ = false;  // a repeated kind of warning: the end has the counts
  std::map<std::string, double> shown_percent_;
  std::size_t ended_ = 0;
};

}  // namespace carillon::queue
