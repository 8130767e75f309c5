#include "jobs/queue/display.hpp"

#include <fmt/core.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <optional>
#include <string>

#include "jobs/store/records.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/printable.hpp"

namespace carillon::queue {
namespace {

constexpr int kBarWidth = 20, kMinColumns = 40, kOtherwiseColumns = 100;

int find_columns() {
  winsize size{};
  if (::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col >= kMinColumns) return size.ws_col;
  return kOtherwiseColumns;
}

std::string clean(const std::string& text) { return base::printable(text); }

std::string format_left(double seconds) {
  if (seconds < 0.0) return "";
  const auto whole = static_cast<long long>(seconds + 0.5);
  if (whole < 3600) return fmt::format(", {}:{:02} left", whole / 60, whole % 60);
  return fmt::format(", {}:{:02}:{:02} left", whole / 3600, whole / 60 % 60, whole % 60);
}

/// At most `columns` characters of UTF-8.
std::string cut(const std::string& text, int columns) {
  std::string out;
  int letters = 0;
  for (const char byte : text) {
    const bool is_continuation = (static_cast<unsigned char>(byte) & 0xc0) == 0x80;
    if (!is_continuation && ++letters > columns) break;
    out += byte;
  }
  return out;
}

}  // namespace

Display::Display(bool json, bool quiet, ReadProgress read_progress)
    : read_progress_(std::move(read_progress)), json_(json), quiet_(quiet), is_terminal_(::isatty(STDOUT_FILENO) == 1 && !json) {}

Display::~Display() {
  clear();
  if (has_repeated_)
    for (const std::string& line : kinds_.list()) print(clean("warning " + line));
}

void Display::clear() {
  if (has_bar_) std::fputs("\r\033[K", stdout);
  has_bar_ = false;
  std::fflush(stdout);
}

void Display::print(const std::string& line) {
  if (quiet_) return;
  clear();
  fmt::print("{}\n", line);
  std::fflush(stdout);
}

void Display::print_event(const std::string& event, const registry::Job& job) {
  const bool is_end = event == "done" || event == "failed" || event == "cancelled";
  if (is_end) ++ended_;
  shown_percent_.erase(job.id.text());
  if (quiet_) return;
  const std::vector<std::string> warnings = event == "done" && find_warnings_ ? find_warnings_(job) : std::vector<std::string>();
  if (json_) {
    base::Json root = base::Json::object();
    root.set("event", event).set("boot_s", base::decimals(base::get_boot_s(), 3)).set("id", job.id.text()).set("name", job.name);
    root.set("ranks", job.given.ranks).set("memory_gb", base::decimals(job.given.memory_gb, 3)).set("attempt", job.attempts);
    root.set("failures", job.failures).set("reason", job.reason);
    if (event == "done") root.set("warnings", base::Json::array(warnings));
    return print(root.line());
  }
  const bool is_in_bar = (event == "start" && job.reason.empty()) || event == "predict";
  if (is_in_bar) return;
  print(fmt::format("{} {}: {}{}{}", job.id.short_text(), clean(job.name), event, job.reason.empty() ? "" : ": ", clean(job.reason)));
  for (const std::string& warning : warnings) {
    if (kinds_.add(job.name, warning))
      print("  warning: " + clean(warning));
    else
      has_repeated_ = true;
  }
}

void Display::print_note(const std::string& text) {
  print(json_ ? base::Json::object().set("event", "note").set("text", text).line() : clean(text));
}

void Display::show(const std::vector<registry::Job>& jobs) {
  if (quiet_) return;
  std::size_t queued = 0, running = 0;
  std::string first;
  for (const registry::Job& job : jobs) {
    if (job.state == registry::JobState::queued || job.state == registry::JobState::waiting) ++queued;
    if (job.state != registry::JobState::running) continue;
    ++running;
    const std::optional<store::Progress> progress = read_progress_(job.id);
    if (!progress) continue;
    if (json_) {
      double& shown = shown_percent_.try_emplace(job.id.text(), -1.0).first->second;
      if (progress->percent == shown) continue;
      shown = progress->percent;
      base::Json root = base::Json::object();
      root.set("event", "progress").set("id", job.id.text()).set("phase", progress->phase);
      root.set("percent", base::decimals(progress->percent, 1)).set("modes_done", progress->modes_done);
      root.set("modes_wanted", progress->modes_wanted >= 0 ? base::Json(progress->modes_wanted) : base::Json());
      root.set("seconds_left", progress->seconds_left >= 0 ? base::decimals(progress->seconds_left, 1) : base::Json());
      print(root.line());
    } else if (first.empty()) {
      const int filled = static_cast<int>(std::clamp(progress->percent / 100.0, 0.0, 1.0) * kBarWidth);
      first = fmt::format("  [{:#>{}}{:.>{}}] {:3.0f} % {} {}{}", "", filled, "", kBarWidth - filled, progress->percent, clean(job.name),
                          clean(progress->phase), format_left(progress->seconds_left));
    }
  }
  if (!is_terminal_) return;
  const std::string line = fmt::format("{} ended, {} running, {} queued{}", ended_, running, queued, first);
  fmt::print("\r\033[K{}", cut(line, find_columns() - 1));
  has_bar_ = true;
  std::fflush(stdout);
}

}  // namespace carillon::queue
