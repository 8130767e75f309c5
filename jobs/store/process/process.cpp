// Method:     A process is identified by number, start time and boot id. The processes of an attempt share an environment entry, which
//             children inherit and /proc/PID/environ shows.
// Source:     Linux proc(5), random(4) (boot_id), namespaces(7), flock(2), clock_gettime(2).
#include "jobs/store/process/process.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <fstream>
#include <sstream>

#include "runtime/base/message.hpp"

namespace carillon::process {
namespace {

namespace fs = std::filesystem;

/// State letter and start of a process; none if it does not exist.
struct Stat {
  char state = 'X';
  std::uint64_t start_ticks = 0;
};
std::optional<Stat> find_stat(pid_t pid) {
  const std::string text = read_proc(fmt::format("/proc/{}/stat", pid));
  const std::size_t end = text.rfind(')');  // the name may contain any character
  if (end == std::string::npos) return std::nullopt;
  std::istringstream fields(text.substr(end + 1));
  const std::vector<std::string> words{std::istream_iterator<std::string>(fields), {}};
  if (words.size() < 20 || words[0].empty()) return std::nullopt;
  Stat stat;
  stat.state = words[0][0];
  std::from_chars(words[19].data(), words[19].data() + words[19].size(), stat.start_ticks);
  return stat;
}

bool is_dead(const std::optional<Stat>& stat) { return !stat || stat->state == 'Z' || stat->state == 'X'; }

bool holds_entry(pid_t pid, std::string_view entry) {
  const std::string environment = read_proc(fmt::format("/proc/{}/environ", pid));
  std::size_t at = 0;
  while (at < environment.size()) {
    const std::size_t end = std::min(environment.find('\0', at), environment.size());
    if (std::string_view(environment).substr(at, end - at) == entry) return true;
    at = end + 1;
  }
  return false;
}

void wait_ms(long milliseconds) {
  const timespec time{milliseconds / 1000, (milliseconds % 1000) * 1000000};
  ::nanosleep(&time, nullptr);
}

}  // namespace

std::string read_proc(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  std::ostringstream text;
  text << stream.rdbuf();  // no exception if the process ends meanwhile
  return text.str();
}

std::string find_host() {
  std::array<char, 256> name{};
  ::gethostname(name.data(), name.size() - 1);
  return name.data();
}

std::string find_boot() {
  std::string boot = read_proc("/proc/sys/kernel/random/boot_id");
  boot.erase(std::remove(boot.begin(), boot.end(), '\n'), boot.end());
  std::error_code error;
  std::string space = fs::read_symlink("/proc/self/ns/pid", error).string();  // "pid:[4026531836]"
  std::erase_if(space, [](char letter) { return letter < '0' || letter > '9'; });
  return boot + ":" + space;
}

Identity find_self() {
  const std::optional<Identity> self = find_process(::getpid());
  if (!self) throw SystemError("/proc does not show this process; mount it");
  return *self;
}

std::optional<Identity> find_process(pid_t pid) {
  const std::optional<Stat> stat = pid > 0 ? find_stat(pid) : std::nullopt;
  if (is_dead(stat)) return std::nullopt;
  return Identity{find_host(), find_boot(), static_cast<int>(pid), stat->start_ticks};
}

bool is_self(const Identity& identity) {
  const Identity self = find_self();
  return identity.pid == self.pid && identity.start_ticks == self.start_ticks && identity.boot == self.boot;
}

Life find_life(const Identity& identity) {
  if (identity.pid <= 0) return Life::gone;
  const std::string boot = find_boot();
  if (identity.boot != boot) {
    // Same boot id: another PID namespace (container). Another boot id on the same host: an earlier boot.
    const bool is_same_kernel = identity.boot.substr(0, identity.boot.find(':')) == boot.substr(0, boot.find(':'));
    return is_same_kernel || identity.host != find_host() ? Life::elsewhere : Life::gone;
  }
  const std::optional<Stat> stat = find_stat(identity.pid);
  return !is_dead(stat) && stat->start_ticks == identity.start_ticks ? Life::running : Life::gone;
}

std::vector<pid_t> find_with_environment(std::string_view entry) {
  std::vector<pid_t> found;
  std::error_code error;
  for (fs::directory_iterator it("/proc", error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename().string();
    pid_t pid = 0;
    if (std::from_chars(name.data(), name.data() + name.size(), pid).ptr != name.data() + name.size() || pid == ::getpid()) continue;
    if (holds_entry(pid, entry) && !is_dead(find_stat(pid))) found.push_back(pid);
  }
  return found;
}

int end_with_environment(std::string_view entry, double patience_s, double grace_s) {
  std::vector<pid_t> seen;
  int empty_looks = 0;  // two in a row: during exec a process has no environment
  for (double waited_s = 0.0;; waited_s += 0.02) {
    const std::vector<pid_t> left = find_with_environment(entry);
    empty_looks = left.empty() ? empty_looks + 1 : 0;
    if (empty_looks == 2) return static_cast<int>(seen.size());
    if (waited_s > grace_s + patience_s && !left.empty())
      throw SystemError(fmt::format("process {} does not end after SIGKILL; look at it with ps", left[0]));
    for (const pid_t pid : left) {
      if (std::find(seen.begin(), seen.end(), pid) == seen.end()) seen.push_back(pid);
      if (waited_s >= grace_s) ::kill(pid, SIGKILL);
    }
    wait_ms(20);
  }
}

std::optional<Lock> Lock::take(const fs::path& file) {
  const auto refuse = [&](const char* what) {
    throw SystemError(fmt::format("{}: cannot {}: {}; {}", file.string(), what, std::strerror(errno), base::find_advice(errno)));
  };
  for (;;) {
    const int descriptor = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666);
    if (descriptor < 0) refuse("create this lock");
    Lock lock(descriptor);
    while (::flock(descriptor, LOCK_EX | LOCK_NB) != 0) {
      if (errno == EINTR) continue;
      if (errno == EWOULDBLOCK) return std::nullopt;
      refuse("lock this file");
    }
    struct stat mine {
    }, named{};
    if (::fstat(descriptor, &mine) != 0) refuse("stat this file");
    // The previous holder may have removed the file.
    if (::stat(file.c_str(), &named) == 0 && named.st_ino == mine.st_ino && named.st_dev == mine.st_dev) return lock;
  }
}

bool Lock::is_held(const fs::path& file) {
  const int descriptor = ::open(file.c_str(), O_RDWR | O_CLOEXEC);
  if (descriptor < 0) return false;
  const bool is_free = ::flock(descriptor, LOCK_SH | LOCK_NB) == 0;
  ::close(descriptor);
  return !is_free;
}

Lock::~Lock() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

}  // namespace carillon::process
