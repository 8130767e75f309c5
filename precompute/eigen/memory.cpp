// Source:     Linux: proc(5) (meminfo, self/statm, self/cgroup), getrlimit(2), Documentation/admin-guide/cgroup-v2.rst (memory.max,
//             memory.current, memory.stat).
#include "precompute/eigen/memory.hpp"

#include <fmt/core.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>

#include "precompute/petsc/session.hpp"
#include "runtime/config/error.hpp"

namespace carillon::eigen {
namespace {

constexpr std::int64_t kUnlimited = std::numeric_limits<std::int64_t>::max();

// The number behind `key` in a file of "key number" lines; `otherwise` if there is none.
std::int64_t read_entry(const std::string& path, const std::string& key, std::int64_t otherwise) {
  std::ifstream file(path);
  std::string word;
  std::int64_t value = 0;
  for (std::string line; std::getline(file, line);) {
    std::istringstream text(line);
    if (text >> word >> value && word == key) return value;
  }
  return otherwise;
}

std::int64_t read_number(const std::string& path, std::int64_t otherwise) {
  std::ifstream file(path);
  std::int64_t value = 0;
  return file >> value ? value : otherwise;  // "max" is no number
}

std::int64_t find_machine_left() {
  const std::int64_t kibibytes = read_entry("/proc/meminfo", "MemAvailable:", -1);
  return kibibytes < 0 ? kUnlimited : kibibytes * 1024;
}

// What this process's control groups leave, from its own up to the root.
std::int64_t find_group_left() {
  std::ifstream file("/proc/self/cgroup");
  std::int64_t left = kUnlimited;
  for (std::string line; std::getline(file, line);) {
    const auto first = line.find(':');
    const auto second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1);
    const bool is_v2 = controllers.empty();
    if (!is_v2 && controllers.find("memory") == std::string::npos) continue;
    const std::string root = is_v2 ? "/sys/fs/cgroup" : "/sys/fs/cgroup/memory";
    for (std::string path = line.substr(second + 1);; path = path.substr(0, path.rfind('/'))) {
      if (path == "/") path.clear();
      const std::string group = root + path;
      const std::int64_t most = read_number(group + (is_v2 ? "/memory.max" : "/memory.limit_in_bytes"), kUnlimited);
      const std::int64_t used = read_number(group + (is_v2 ? "/memory.current" : "/memory.usage_in_bytes"), 0);
      const std::int64_t cached = read_entry(group + "/memory.stat", is_v2 ? "inactive_file" : "total_inactive_file", 0);
      if (most < kUnlimited / 2) left = std::min(left, std::max<std::int64_t>(most - used + cached, 0));
      if (path.empty()) break;
    }
  }
  return left;
}

// Address space and resident memory of this process [byte].
struct Usage {
  std::int64_t address_space = 0;
  std::int64_t resident = 0;
};
Usage find_usage() {
  std::ifstream file("/proc/self/statm");
  Usage usage;
  file >> usage.address_space >> usage.resident;
  const std::int64_t page = sysconf(_SC_PAGESIZE);
  return {usage.address_space * page, usage.resident * page};
}

std::int64_t find_process_left(const Usage& usage) {
  rlimit limit{};
  if (getrlimit(RLIMIT_AS, &limit) != 0 || limit.rlim_cur == RLIM_INFINITY) return kUnlimited;
  return std::max<std::int64_t>(static_cast<std::int64_t>(limit.rlim_cur) - usage.address_space, 0);
}

double to_gb(std::int64_t bytes) { return static_cast<double>(bytes) / 1e9; }

}  // namespace

std::int64_t find_memory_left() { return std::min({find_machine_left(), find_group_left(), find_process_left(find_usage())}); }

void check_memory(MPI_Comm comm, std::int64_t need_bytes, std::int64_t limit_bytes, const std::string& what) {
  const Usage usage = find_usage();
  MPI_Comm host = MPI_COMM_NULL;
  MPI_Comm_split_type(comm, MPI_COMM_TYPE_SHARED, 0, MPI_INFO_NULL, &host);
  std::array<std::int64_t, 2> together{need_bytes, usage.resident};
  int ranks = 1;
  MPI_Comm_size(host, &ranks);
  MPI_Allreduce(MPI_IN_PLACE, together.data(), 2, MPI_INT64_T, MPI_SUM, host);
  std::int64_t left = std::min(find_machine_left(), find_group_left());
  if (limit_bytes > 0) left = std::min(left, std::max<std::int64_t>(limit_bytes - together[1], 0));
  MPI_Allreduce(MPI_IN_PLACE, &left, 1, MPI_INT64_T, MPI_MIN, host);
  MPI_Comm_free(&host);
  const std::int64_t own_left = find_process_left(usage);
  std::int64_t everywhere = need_bytes;
  MPI_Allreduce(MPI_IN_PLACE, &everywhere, 1, MPI_INT64_T, MPI_SUM, comm);
  petsc::run_agreed(comm, [&] {
    constexpr const char* kMend = "Take a coarser mesh, a narrower band or fewer modes, or more ranks on more machines.";
    if (need_bytes > own_left) {
      throw SystemError(
          fmt::format("{} needs about {:.2f} GB on one rank ({:.2f} GB on all), and this process may take {:.2f} GB more "
                      "(ulimit -v). {}",
                      what, to_gb(need_bytes), to_gb(everywhere), to_gb(own_left), kMend));
    }
    if (together[0] > left) {
      std::array<char, 256> name{};
      gethostname(name.data(), name.size() - 1);
      throw SystemError(
          fmt::format("{} needs about {:.2f} GB on {} ({} ranks; {:.2f} GB on all machines), and {:.2f} GB are left there. {}", what,
                      to_gb(together[0]), name.data(), ranks, to_gb(everywhere), to_gb(left), kMend));
    }
  });
}

}  // namespace carillon::eigen
