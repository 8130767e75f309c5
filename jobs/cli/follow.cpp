#include "jobs/cli/follow.hpp"

#include <fmt/core.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <map>
#include <thread>

#include "jobs/cli/status.hpp"
#include "runtime/base/error.hpp"

namespace carillon::cli {
namespace {

constexpr auto kPause = std::chrono::milliseconds(500);
constexpr int kDefaultRows = 24, kDefaultColumns = 80;

std::vector<registry::Job> read_jobs(Shared& shared, const std::vector<store::Id>& ids) {
  shared.settle();
  if (ids.empty()) return shared.registry().list();
  std::vector<registry::Job> jobs;
  for (const store::Id& id : ids) {
    if (auto job = shared.registry().find(id)) jobs.push_back(std::move(*job));
  }
  return jobs;
}

bool has_ended(const registry::Job& job) { return !is_open(job.state); }

/// Redraws the jobs in place, limited to the rows of the terminal.
class Screen {
 public:
  void draw(Shared& shared, const std::vector<registry::Job>& jobs) {
    winsize size{};
    const bool is_known = ::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_row > 4 && size.ws_col > 20;
    const std::size_t rows = is_known ? size.ws_row : kDefaultRows, columns = is_known ? size.ws_col : kDefaultColumns;
    std::string text = lines_ > 0 ? fmt::format("\x1b[{}A\x1b[J", lines_) : "";
    lines_ = 0;
    for (const std::string& line : format_bars(shared, jobs, rows - 2, columns)) {
      text += line + "\n";
      ++lines_;
    }
    fmt::print("{}", text);
    std::fflush(stdout);
  }

 private:
  std::size_t lines_ = 0;
};

/// Prints changed jobs.
void print_changes(Shared& shared, const std::vector<registry::Job>& jobs, std::map<store::Id, std::string>& before) {
  for (const registry::Job& job : jobs) {
    if (has_ended(job) && before.count(job.id) > 0 && before[job.id] == to_text(job.state)) continue;
    const std::string line = describe(shared, job).sorted_text({.is_ascii = false});
    std::string& known = before[job.id];
    if (known != line) fmt::print("{}\n", store::to_plain_json(line));
    known = has_ended(job) ? to_text(job.state) : line;
  }
  if (std::fflush(stdout) != 0) throw SystemError("the output cannot be written");
}

}  // namespace

int find_exit_code(const std::vector<registry::Job>& jobs) {
  const auto is = [&](registry::JobState state) { return [state](const registry::Job& job) { return job.state == state; }; };
  if (std::any_of(jobs.begin(), jobs.end(), is(registry::JobState::failed)) ||
      std::any_of(jobs.begin(), jobs.end(), is(registry::JobState::cancelled)))
    return kExitSolve;
  return std::all_of(jobs.begin(), jobs.end(), is(registry::JobState::done)) ? 0 : kExitNotYet;
}

int follow(Shared& shared, const std::vector<store::Id>& ids, bool lines) {
  const bool is_terminal = ::isatty(STDOUT_FILENO) != 0 && !shared.json;
  Screen screen;
  std::map<store::Id, std::string> before;
  for (;;) {
    const std::vector<registry::Job> jobs = read_jobs(shared, ids);
    if (is_terminal)
      screen.draw(shared, jobs);
    else if (lines)
      print_changes(shared, jobs, before);
    if (std::all_of(jobs.begin(), jobs.end(), has_ended)) return find_exit_code(jobs);
    std::this_thread::sleep_for(kPause);
  }
}

}  // namespace carillon::cli
