#include "jobs/queue/local.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <signal.h>
#include <sys/wait.h>
#include <time.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <fstream>
#include <map>

#include "jobs/queue/attempt/attempt.hpp"
#include "jobs/queue/attempt/processes.hpp"
#include "jobs/store/files.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/base/command.hpp"
#include "runtime/base/descriptor.hpp"

namespace carillon::queue {

bool LocalDisk::is_locked(const store::Id& id) const { return process::Lock::is_held(store_.work_folder(id) / "lock"); }

std::optional<outcome::Attempt> LocalDisk::read_attempt(const store::Id& id) const { return outcome::read_attempt(store_.work_folder(id)); }

std::optional<outcome::Outcome> LocalDisk::read_outcome(const store::Id& id) const { return outcome::read_outcome(store_.work_folder(id)); }

bool LocalDisk::is_full(const std::exception* error) const {
  return error == nullptr ? store::is_disk_full(store_.root())
                          : store::is_disk_full(store_.root(), *error) || store::is_disk_full(store_.registry_folder());
}

double LocalClock::get_boot_s() const { return base::get_boot_s(); }
std::string LocalClock::get_boot_id() const { return process::find_boot(); }

int LocalClock::wait(double seconds) {
  sigset_t set;
  ::sigemptyset(&set);
  for (const int signal : {SIGTERM, SIGINT, SIGHUP, SIGCHLD}) ::sigaddset(&set, signal);
  const double whole = std::floor(seconds);
  const timespec time{static_cast<time_t>(whole), static_cast<long>(1e9 * (seconds - whole))};
  const int signal = ::sigtimedwait(&set, nullptr, &time);
  return signal == SIGTERM || signal == SIGINT || signal == SIGHUP ? signal : 0;
}

pid_t LocalLauncher::start(const registry::Job& job, const StartOptions& options) {
  attempt::Options attempt;
  attempt.work = store_.work_folder(job.id);
  attempt.ranks = job.given.ranks;
  attempt.memory_gb = job.given.memory_gb;
  attempt.memory_limit_gb = job.resources.memory_gb;
  attempt.time_limit_s = options.time_limit_s;
  attempt.token = job.token;
  attempt.is_prediction = options.is_prediction;
  attempt.mpirun_options = command_.mpirun_options;
  attempt.has_pictures = command_.has_pictures;
  const std::vector<std::string> words = attempt::make_arguments(command_.program, attempt);
  const std::filesystem::path log = attempt.work / store::kLogFile;
  if (attempt.ranks == 1 && !options.is_simulation && options.signal_at_end == 0) {
    if (const std::optional<pid_t> pid = worker_.start(log, words)) return *pid;
  }
  const base::Descriptor output(::open(log.c_str(), O_WRONLY | O_APPEND | O_CREAT | O_CLOEXEC, 0666));
  if (output.get() < 0) throw SystemError(fmt::format("{}: cannot write: {}", log.string(), std::strerror(errno)));
  // Signals stay pending until the attempt handles them.
  return base::start({.words = words,
                      .output = output.get(),
                      .errors = output.get(),
                      .group = base::Command::Group::session,
                      .signal_at_end = options.signal_at_end,
                      .blocked = {SIGUSR1, SIGTERM, SIGINT, SIGHUP},
                      .default_signals = true});
}

std::optional<EndedChild> LocalLauncher::reap_child() {
  int status = 0;
  const pid_t pid = ::waitpid(-1, &status, WNOHANG);
  if (pid <= 0) return std::nullopt;
  return EndedChild{pid, WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status)};
}

bool LocalLauncher::send_signal(pid_t pid, int signal) { return ::kill(pid, signal) == 0; }

std::optional<process::Identity> LocalLauncher::find_process(pid_t pid) const {
  return pid == 0 ? process::find_self() : process::find_process(pid);
}

bool LocalLauncher::is_attempt_of(const registry::Job& job, const process::Identity& found) const {
  const bool is_token = job.token.size() == 32 && job.token.find_first_not_of("0123456789abcdef") == std::string::npos;
  if (!is_token || process::find_life(found) != process::Life::running) return false;
  std::ifstream words(fmt::format("/proc/{}/cmdline", found.pid), std::ios::binary);
  for (std::string word; std::getline(words, word, '\0');) {
    if (word == job.token) return true;
  }
  return false;
}

bool LocalLauncher::is_orphan(pid_t pid) const {
  const std::map<pid_t, attempt::Usage> self = attempt::find_below(pid);
  const auto usage = self.find(pid);
  if (usage == self.end()) return false;
  const auto parents = attempt::find_below(usage->second.parent);
  const auto parent = parents.find(usage->second.parent);
  return parent == parents.end() || parent->second.name != "carillon";
}

double LocalLauncher::find_used_gb(pid_t pid) const {
  double used_gb = 0.0;
  for (const auto& [below, usage] : attempt::find_below(pid)) used_gb += 1e-9 * static_cast<double>(usage.resident_bytes);
  return used_gb;
}

}  // namespace carillon::queue
