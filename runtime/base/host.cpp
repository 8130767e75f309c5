// Method: minimum over the machine and all control groups from that of this process up to the root.
// Source: Linux sched_getaffinity(2), getrlimit(2), proc(5) (meminfo, self/cgroup, self/status),
//   Documentation/admin-guide/cgroup-v2.rst (cpu.max, memory.max), cgroup-v1/memory.rst, scheduler/sched-bwc.rst (cpu.cfs_quota_us).
#include "runtime/base/host.hpp"

#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <limits>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

namespace carillon::base {
namespace {

constexpr double kUnlimited = 1e18;  // "no limit" of cgroup v1 is larger

/// First number of a file; nullopt without file or number ("max").
std::optional<double> read_number(const std::string& file) {
  std::ifstream stream(file);
  double value = 0.0;
  if (stream >> value) return value;
  return std::nullopt;
}

/// Numbers after `names` in a file of lines "name number"; 0 if absent.
template <std::size_t n>
std::array<double, n> read_entries(const std::string& file, const std::array<const char*, n>& names) {
  std::array<double, n> values{};
  std::ifstream stream(file);
  std::string word;
  double value = 0.0;
  for (std::string line; std::getline(stream, line);) {
    std::istringstream fields(line);
    if (!(fields >> word >> value)) continue;
    for (std::size_t i = 0; i < n; ++i)
      if (word == names[i]) values[i] = value;
  }
  return values;
}

/// Folders of this process's group and its ancestors; `controller` "": version 2.
std::vector<std::string> find_groups(const std::string& controller) {
  std::ifstream stream("/proc/self/cgroup");
  for (std::string line; std::getline(stream, line);) {
    const std::size_t first = line.find(':'), second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    const std::string names = "," + line.substr(first + 1, second - first - 1) + ",";
    const bool is_it = controller.empty() ? names == ",," : names.find("," + controller + ",") != std::string::npos;
    if (!is_it) continue;
    std::string path = line.substr(second + 1);
    std::vector<std::string> groups;
    for (;;) {
      const std::string root = controller.empty() ? "/sys/fs/cgroup" : "/sys/fs/cgroup/" + controller;
      groups.push_back(path == "/" ? root : root + path);
      if (path.empty() || path == "/") return groups;
      path.resize(path.rfind('/'));
    }
  }
  return {};
}

int find_cores() {
  cpu_set_t set;
  CPU_ZERO(&set);
  double cores = static_cast<double>(::sysconf(_SC_NPROCESSORS_ONLN));
  if (::sched_getaffinity(0, sizeof set, &set) == 0) cores = CPU_COUNT(&set);
  for (const std::string& group : find_groups("")) {
    std::ifstream stream(group + "/cpu.max");
    std::string quota;
    double period = 0.0;
    if (stream >> quota >> period && quota != "max" && period > 0.0) cores = std::min(cores, std::stod(quota) / period);
  }
  for (const std::string& group : find_groups("cpu")) {
    const double quota = read_number(group + "/cpu.cfs_quota_us").value_or(-1.0);
    const double period = read_number(group + "/cpu.cfs_period_us").value_or(0.0);
    if (quota > 0.0 && period > 0.0) cores = std::min(cores, quota / period);
  }
  return std::max(1, static_cast<int>(std::floor(cores + 1e-6)));
}

/// Reduces total and available memory to the limits of the groups.
void heed_groups(bool is_v2, double& total, double& available) {
  for (const std::string& group : find_groups(is_v2 ? "" : "memory")) {
    const double max = read_number(group + (is_v2 ? "/memory.max" : "/memory.limit_in_bytes")).value_or(kUnlimited);
    if (max >= kUnlimited) continue;
    const double used = read_number(group + (is_v2 ? "/memory.current" : "/memory.usage_in_bytes")).value_or(0.0);
    const auto [cached] = read_entries<1>(group + "/memory.stat", {is_v2 ? "inactive_file" : "total_inactive_file"});
    total = std::min(total, max);
    available = std::min(available, std::max(max - used + cached, 0.0));
  }
}

}  // namespace

Host find_host() {
  const auto [total_kb, available_kb] = read_entries<2>("/proc/meminfo", {"MemTotal:", "MemAvailable:"});
  double total = total_kb > 0.0 ? 1024.0 * total_kb : kUnlimited;
  double available = available_kb > 0.0 ? 1024.0 * available_kb : total;
  heed_groups(true, total, available);
  heed_groups(false, total, available);
  return {find_cores(), 1e-9 * total, 1e-9 * std::min(total, available)};
}

Memory find_memory() {
  const auto kb = read_entries<3>("/proc/self/status", {"VmSize:", "VmRSS:", "VmHWM:"});
  const auto to_bytes = [](double size_kb) { return static_cast<std::int64_t>(size_kb) * 1024; };
  Memory memory{.address_space = to_bytes(kb[0]), .resident = to_bytes(kb[1]), .peak = to_bytes(kb[2])};
  if (memory.peak > 0) return memory;
  rusage used{};  // may include the parent process
  ::getrusage(RUSAGE_SELF, &used);
  memory.peak = static_cast<std::int64_t>(used.ru_maxrss) * 1024;
  return memory;
}

std::int64_t find_address_space_left() {
  rlimit limit{};
  if (::getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return std::numeric_limits<std::int64_t>::max();
  return std::max<std::int64_t>(static_cast<std::int64_t>(limit.rlim_cur) - find_memory().address_space, 0);
}

}  // namespace carillon::base
