#include "jobs/queue/display.hpp"

#include <fmt/core.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <optional>
#include <string>

#include "jobs/process/process.hpp"
#include "jobs/store/records.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/printable.hpp"

namespace carillon::queue {
namespace {

constexpr int kBarWidth = 20, kLeastColumns = 40, kOtherwiseColumns = 100;

int find_columns() {
  winsize size{};
  if (::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col >= kLeastColumns) return size.ws_col;
  return kOtherwiseColumns;
}

std::string clean(const std::string& text) { return base::printable(text); }
std::string quote(const std::string& text) { return store::to_plain_json(base::quote(text)); }

std::string format_left(double seconds) {
  if (seconds < 0.0) return "";
  const auto whole = static_cast<long long>(seconds + 0.5);
  if (whole < 3600) return fmt::format(", {}:{:02} left", whole / 60, whole % 60);
  return fmt::format(", {}:{:02}:{:02} left", whole / 3600, whole / 60 % 60, whole % 60);
}

/// At most `columns` letters of UTF-8.
std::string cut(const std::string& text, int columns) {
  std::string out;
  int letters = 0;
  for (const char byte : text) {
    const bool goes_on = (static_cast<unsigned char>(byte) & 0xc0) == 0x80;
    if (!goes_on && ++letters > columns) break;
    out += byte;
  }
  return out;
}

}  // namespace

Display::Display(bool json, bool quiet) : json_(json), quiet_(quiet), is_terminal_(::isatty(STDOUT_FILENO) == 1 && !json) {
  if (!is_terminal_) json_ = true;
}

Display::~Display() { clear(); }

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

void Display::tell(const std::string& event, const registry::Job& job, const std::vector<std::string>& warnings) {
  const bool is_end = event == "done" || event == "failed" || event == "cancelled";
  if (is_end) ++ended_;
  told_percent_.erase(job.id.text());
  if (json_) {
    std::string list = event == "done" ? ", \"warnings\": [" : "";
    for (std::size_t i = 0; i < warnings.size(); ++i) list += (i > 0 ? ", " : "") + quote(warnings[i]);
    if (event == "done") list += "]";
    return print(fmt::format(
        "{{\"event\": \"{}\", \"boot_s\": {:.3f}, \"id\": \"{}\", \"name\": {}, \"ranks\": {}, \"memory_gb\": {:.3f}, \"attempt\": {}, "
        "\"failures\": {}, \"reason\": {}{}}}",
        event, process::find_boot_seconds(), job.id.text(), quote(job.name), job.given.ranks, job.given.memory_gb, job.attempts,
        job.failures, quote(job.reason), list));
  }
  const bool is_in_bar = (event == "start" && job.reason.empty()) || event == "predict";
  if (is_in_bar) return;
  print(fmt::format("{} {}: {}{}{}", job.id.short_text(), clean(job.name), event, job.reason.empty() ? "" : ": ", clean(job.reason)));
  for (const std::string& warning : warnings) print("  warning: " + clean(warning));
}

void Display::say(const std::string& text) {
  print(json_ ? fmt::format("{{\"event\": \"note\", \"text\": {}}}", quote(text)) : clean(text));
}

void Display::show(const store::Store& store, const std::vector<registry::Job>& jobs) {
  if (quiet_) return;
  std::size_t queued = 0, running = 0;
  std::string first;
  for (const registry::Job& job : jobs) {
    if (job.state == registry::State::queued || job.state == registry::State::waiting) ++queued;
    if (job.state != registry::State::running) continue;
    ++running;
    const std::optional<store::Progress> progress = store::read_progress(store.work_folder(job.id));
    if (!progress) continue;
    if (json_) {
      double& told = told_percent_.try_emplace(job.id.text(), -1.0).first->second;
      if (progress->percent == told) continue;
      told = progress->percent;
      print(fmt::format(
          "{{\"event\": \"progress\", \"id\": \"{}\", \"phase\": {}, \"percent\": {:.1f}, \"modes_done\": {}, \"modes_wanted\": {}, "
          "\"seconds_left\": {}}}",
          job.id.text(), quote(progress->phase), progress->percent, progress->modes_done,
          progress->modes_wanted >= 0 ? std::to_string(progress->modes_wanted) : "null",
          progress->seconds_left >= 0 ? fmt::format("{:.1f}", progress->seconds_left) : "null"));
    } else if (first.empty()) {
      const int filled = static_cast<int>(std::clamp(progress->percent / 100.0, 0.0, 1.0) * kBarWidth);
      first = fmt::format("  [{:#>{}}{:.>{}}] {:3.0f} % {} {}{}", "", filled, "", kBarWidth - filled, progress->percent, clean(job.name),
                          clean(progress->phase), format_left(progress->seconds_left));
    }
  }
  if (json_) return;
  const std::string line = fmt::format("{} ended, {} running, {} queued{}", ended_, running, queued, first);
  fmt::print("\r\033[K{}", cut(line, find_columns() - 1));
  has_bar_ = true;
  std::fflush(stdout);
}

}  // namespace carillon::queue
