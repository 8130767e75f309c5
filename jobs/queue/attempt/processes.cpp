// Source:     Linux proc(5); Documentation/scheduler/sched-stats.rst (schedstat).
#include "jobs/queue/attempt/processes.hpp"

#include <fmt/core.h>
#include <unistd.h>

#include <charconv>
#include <filesystem>
#include <sstream>
#include <vector>

#include "jobs/store/process/process.hpp"

namespace carillon::attempt {
namespace {

namespace fs = std::filesystem;

template <typename Number>
Number parse(const std::string& text) {
  Number value = 0;
  std::from_chars(text.data(), text.data() + text.size(), value);
  return value;
}

/// False for zombies and ended processes.
bool read_usage(pid_t pid, Usage& usage) {
  const std::string text = process::read_proc(fmt::format("/proc/{}/stat", pid));
  const std::size_t open = text.find('('), close = text.rfind(')');
  if (open == std::string::npos || close == std::string::npos || close < open) return false;
  std::istringstream fields(text.substr(close + 1));
  const std::vector<std::string> words{std::istream_iterator<std::string>(fields), {}};
  if (words.size() < 22 || words[0] == "Z" || words[0] == "X") return false;
  usage.parent = parse<pid_t>(words[1]);
  usage.name = text.substr(open + 1, close - open - 1);
  usage.resident_bytes = parse<std::uint64_t>(words[21]) * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
  const std::uint64_t ticks = parse<std::uint64_t>(words[11]) + parse<std::uint64_t>(words[12]);
  usage.cpu_ns = ticks * (1000000000ULL / static_cast<std::uint64_t>(::sysconf(_SC_CLK_TCK)));
  return true;
}

}  // namespace

std::map<pid_t, Usage> find_below(pid_t root) {
  std::map<pid_t, Usage> all;
  std::error_code error;
  for (fs::directory_iterator it("/proc", error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    const pid_t pid = parse<pid_t>(name);
    Usage usage;
    if (pid > 0 && read_usage(pid, usage)) all.emplace(pid, usage);
  }
  std::map<pid_t, Usage> below;
  for (const auto& [pid, usage] : all) {
    pid_t at = pid;
    for (std::size_t step = 0; at > 1 && at != root && step < all.size(); ++step) {
      const auto parent = all.find(at);
      at = parent == all.end() ? 0 : parent->second.parent;
    }
    if (at == root) below.emplace(pid, usage);
  }
  for (auto& [pid, usage] : below) {
    // Finer than clock ticks: a polling process may use less than one.
    if (const std::string text = process::read_proc(fmt::format("/proc/{}/schedstat", pid)); !text.empty())
      usage.cpu_ns = parse<std::uint64_t>(text);
  }
  return below;
}

std::uint64_t calc_cpu_below(const std::map<pid_t, Usage>& all, pid_t pid) {
  const auto self = all.find(pid);
  std::uint64_t sum = self == all.end() ? 0 : self->second.cpu_ns;
  for (const auto& [child, usage] : all) {
    if (usage.parent == pid && child != pid) sum += calc_cpu_below(all, child);
  }
  return sum;
}

std::uint64_t find_memory_kills() {
  std::istringstream lines(process::read_proc("/proc/vmstat"));
  std::string name;
  std::uint64_t value = 0;
  while (lines >> name >> value) {
    if (name == "oom_kill") return value;
  }
  return 0;
}

}  // namespace carillon::attempt
