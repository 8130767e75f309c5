// carillon status: states of jobs.
#include "jobs/cli/status.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "jobs/cli/commands.hpp"
#include "jobs/cli/follow.hpp"
#include "jobs/store/process/process.hpp"
#include "jobs/store/warning_kinds.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/base/error.hpp"

namespace carillon::cli {
namespace {

constexpr std::size_t kMaxRows = 50, kWideColumns = 1000, kBarWidth = 20, kMaxKinds = 10;

/// Order: running, waiting, queued, failed, cancelled, done; ended jobs newest first.
void sort_for_people(std::vector<registry::Job>& jobs) {
  const auto rank = [](registry::JobState state) {
    const std::map<registry::JobState, int> order{{registry::JobState::running, 0},   {registry::JobState::waiting, 1},
                                                  {registry::JobState::queued, 2},    {registry::JobState::failed, 3},
                                                  {registry::JobState::cancelled, 4}, {registry::JobState::done, 5}};
    return order.at(state);
  };
  std::stable_sort(jobs.begin(), jobs.end(), [&](const registry::Job& a, const registry::Job& b) {
    if (rank(a.state) != rank(b.state)) return rank(a.state) < rank(b.state);
    return rank(a.state) >= 3 && a.ended_unix_s > b.ended_unix_s;
  });
}

std::string format_counts(const std::vector<registry::Job>& jobs) {
  std::map<registry::JobState, std::size_t> counts;
  for (const registry::Job& job : jobs) ++counts[job.state];
  std::string text = fmt::format("{} job{}", jobs.size(), jobs.size() == 1 ? "" : "s");
  for (const auto& [state, count] : counts)
    text += fmt::format("{} {} {}", text.find(':') == std::string::npos ? ":" : ",", count, to_text(state));
  return text;
}

std::string format_bar(double percent) {
  const std::size_t full = std::lround(percent / 100.0 * kBarWidth);
  return "[" + std::string(full, '#') + std::string(kBarWidth - full, '.') + "]";
}

std::string format_progress(Shared& shared, const registry::Job& job) {
  const auto progress = store::read_progress(shared.store().work_folder(job.id));
  if (!progress) return job.state == registry::JobState::running ? "starts" : "";
  std::string text = fmt::format("{} {:3.0f} %  {}", format_bar(progress->percent), progress->percent, show(progress->phase, 30));
  if (progress->modes_done >= 0)
    text +=
        fmt::format("  {}{} modes", progress->modes_done, progress->modes_wanted >= 0 ? fmt::format("/{}", progress->modes_wanted) : "");
  if (progress->seconds_left >= 0 && job.state == registry::JobState::running)
    text += fmt::format("  {} left", format_seconds(progress->seconds_left));
  return text;
}

/// Reason of a state, and the remaining wait.
std::string format_reason(Shared& shared, const registry::Job& job) {
  std::string reason = show_message(find_reason(shared, job));
  if (job.state == registry::JobState::waiting) {
    const double left_s = job.ready_boot_id == process::find_boot() ? job.ready_boot_s - base::get_boot_s() : 0.0;
    if (left_s > 0) reason += fmt::format("{}again in {}", reason.empty() ? "" : "; ", format_seconds(left_s));
  }
  return reason;
}

std::string cut(const std::string& text, std::size_t columns) {
  std::size_t at = 0, seen = 0;
  while (at < text.size() && seen < columns) {
    ++at;
    while (at < text.size() && (static_cast<unsigned char>(text[at]) & 0xC0U) == 0x80U) ++at;
    ++seen;
  }
  return text.substr(0, at);
}

}  // namespace

int run_status(Shared& shared, const StatusOptions& options) {
  shared.only_reads = true;
  shared.settle();
  std::vector<registry::Job> jobs = options.words.empty() ? shared.registry().list() : find_jobs(shared, options.words);
  if (options.watch) {
    std::vector<store::Id> ids;
    for (const registry::Job& job : jobs) {
      if (is_open(job.state) || !options.words.empty()) ids.push_back(job.id);
    }
    const int code = ids.empty() ? 0 : follow(shared, ids, true);
    if (!options.words.empty()) return code;
    // Without ids: also jobs that ended before.
    return std::max(code, find_exit_code(shared.registry().list({registry::JobState::failed, registry::JobState::cancelled})));
  }
  if (shared.json) {
    base::Json root;
    root.set("store", to_json(shared.store().root().string())).set("read_only", !shared.store().may_write());
    root.set("jobs", base::Json::array());
    for (const char* state : {"queued", "running", "waiting", "done", "failed", "cancelled"}) root["counts"][state] = 0;
    for (const registry::Job& job : jobs) {
      root["jobs"].append(describe(shared, job));
      base::Json& count = root["counts"][to_text(job.state)];
      count = std::lround(count.as_double()) + 1;
    }
    print_json(root);
    return 0;
  }
  if (jobs.empty()) {
    fmt::print("no jobs in {}; carillon submit JOB.json asks for a bank\n", show(shared.store().root().string()));
    return 0;
  }
  const std::size_t rows = options.all || !options.words.empty() ? jobs.size() * 60 + 1 : kMaxRows + kMaxKinds + 1;
  for (const std::string& line : format_bars(shared, jobs, rows, kWideColumns)) fmt::print("{}\n", line);
  if (std::fflush(stdout) != 0) throw SystemError("the output cannot be written");
  if (shared.is_disk_full()) return 0;
  if (!shared.store().may_write()) fmt::print(stderr, "carillon: read-only store; states are read from its files\n");
  return 0;
}

std::vector<std::string> format_bars(Shared& shared, const std::vector<registry::Job>& unsorted, std::size_t rows, std::size_t columns) {
  std::vector<registry::Job> jobs = unsorted;
  sort_for_people(jobs);
  std::vector<std::string> lines;
  store::WarningKinds kinds;  // of the jobs shown
  const std::size_t job_rows = jobs.size() == 1 ? rows : rows - std::min(rows / 4, kMaxKinds + 1);
  std::size_t shown = 0;
  for (const registry::Job& job : jobs) {
    const std::string reason = format_reason(shared, job);
    if (lines.size() + (reason.empty() ? 1 : 2) + 2 > job_rows && jobs.size() > 1 && shown + 1 < jobs.size()) break;
    ++shown;
    const bool has_progress = job.state == registry::JobState::running || job.state == registry::JobState::waiting;
    const std::string progress = has_progress ? format_progress(shared, job) : "";
    lines.push_back(cut(fmt::format("{}  {:<9}  {}{}{}", job.id.short_text(), to_text(job.state), show(job.name, 40),
                                    progress.empty() ? "" : "  ", progress),
                        columns));
    if (!reason.empty()) lines.push_back(cut(fmt::format("              {}", reason), columns));
    for (const std::string& warning : find_warnings(shared, job)) {
      if (jobs.size() == 1)
        lines.push_back(cut("              warning: " + show_message(warning), columns));
      else
        kinds.add(show(job.name, 40), show_message(warning));
    }
  }
  if (shown < jobs.size()) lines.push_back(fmt::format("... and {} more; --all shows them", jobs.size() - shown));
  lines.push_back(cut(format_counts(jobs), columns));
  const std::vector<std::string> warnings = kinds.list();
  for (std::size_t k = 0; k < warnings.size() && lines.size() < rows; ++k) {
    const bool has_room = k + 1 == warnings.size() || lines.size() + 1 < rows;
    lines.push_back(has_room ? cut("warning " + warnings[k], columns)
                             : fmt::format("... and {} more kinds of warnings", warnings.size() - k));
  }
  return lines;
}

}  // namespace carillon::cli
