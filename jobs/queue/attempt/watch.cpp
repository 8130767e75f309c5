// Method:     One thread waits for signals with a timeout. To stop a job: SIGUSR1 ("save and stop"; mpirun forwards it and, unlike SIGTERM,
//             keeps the exit code of the ranks), repeated every ten seconds because mpirun loses it during startup; SIGTERM after the grace
//             period; SIGKILL to all processes with the attempt's token five seconds later. Hang: a rank used no CPU time while no process
//             wrote output (waiting ranks poll and use CPU time). Time is counted in short steps of the monotonic clock, so that suspending
//             the machine does not end a job.
// Source:     Open MPI 4.1 mpirun(1), signal forwarding; Linux prctl(2), sigtimedwait(2).
#include "jobs/queue/attempt/watch.hpp"

#include <signal.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>

#include <algorithm>
#include <cerrno>
#include <map>

#include "jobs/queue/attempt/processes.hpp"
#include "jobs/store/process/process.hpp"
#include "jobs/store/store.hpp"
#include "runtime/base/clock.hpp"

namespace carillon::attempt {
namespace {

constexpr double kStepS = 0.5, kMaxStepS = 2.0, kLookS = 2.0, kAskAgainS = 10.0, kTermS = 5.0;
/// Names as truncated by the kernel.
bool is_rank_name(const std::string& name) { return name == "carillon-precom" || name == "carillon-simula"; }

sigset_t make_signals() {
  sigset_t set;
  ::sigemptyset(&set);
  for (const int signal : {SIGTERM, SIGINT, SIGHUP, SIGUSR1, SIGCHLD}) ::sigaddset(&set, signal);
  return set;
}

class Watcher {
 public:
  Watcher(pid_t child, const Options& options, const std::string& token)
      : child_(child), options_(options), entry_("CARILLON_ATTEMPT=" + token) {}

  Watched run() {
    double before = base::get_steady_s();
    while (!reap()) {
      handle(wait_for_signal());
      const double now = base::get_steady_s();
      const double step = std::clamp(now - before, 0.0, kMaxStepS);
      before = now;
      advance(step);
    }
    process::end_with_environment(entry_);
    while (::waitpid(-1, nullptr, WNOHANG) > 0) {
    }
    return watched_;
  }

 private:
  static int wait_for_signal() {
    const sigset_t set = make_signals();
    const timespec step{0, static_cast<long>(kStepS * 1e9)};
    return ::sigtimedwait(&set, nullptr, &step);
  }

  /// True when the child has ended. Also reaps adopted orphans.
  bool reap() {
    for (;;) {
      int status = 0;
      const pid_t ended = ::waitpid(-1, &status, WNOHANG);
      if (ended < 0 && errno == EINTR) continue;
      if (ended < 0) watched_.exit_code = kExitSystem;  // no child: its status was taken elsewhere
      if (ended <= 0) return ended < 0;
      if (ended != child_) continue;
      watched_.exit_code = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
      return true;
    }
  }

  void handle(int signal) {
    if (signal != SIGTERM && signal != SIGINT && signal != SIGHUP && signal != SIGUSR1) return;
    if (watched_.was_asked_to_stop && (signal == SIGTERM || signal == SIGINT)) stopping_s_ = std::max(stopping_s_, options_.grace_s);
    watched_.was_asked_to_stop = true;
  }

  void advance(double step) {
    elapsed_s_ += step;
    if (options_.time_limit_s > 0.0 && elapsed_s_ >= options_.time_limit_s && !watched_.was_asked_to_stop) watched_.was_out_of_time = true;
    if (watched_.was_asked_to_stop || watched_.was_out_of_time) stop(step);
    look_s_ += step;
    const double pause_s = options_.memory_limit_gb > 0.0 ? kStepS : kLookS;
    if (look_s_ < std::min(pause_s, 0.5 * elapsed_s_)) return;  // short intervals first, for small jobs
    look(look_s_);
    look_s_ = 0.0;
  }

  /// SIGUSR1, then SIGTERM, then SIGKILL.
  void stop(double step) {
    const double before = stopping_s_;
    stopping_s_ += step;
    if (stopping_s_ > options_.grace_s + kTermS) {
      process::end_with_environment(entry_);
    } else if (stopping_s_ > options_.grace_s) {
      if (!is_terminated_) ::kill(child_, SIGTERM);
      is_terminated_ = true;
    } else if (before == 0.0 || static_cast<int>(before / kAskAgainS) != static_cast<int>(stopping_s_ / kAskAgainS)) {
      ::kill(child_, SIGUSR1);
    }
  }

  /// Checks memory and progress.
  void look(double since_s) {
    const std::map<pid_t, Usage> all = find_below(child_);
    double bytes = 0.0;
    for (const auto& [pid, usage] : all) bytes += static_cast<double>(usage.resident_bytes);
    watched_.peak_memory_gb = std::max(watched_.peak_memory_gb, 1e-9 * bytes);
    if (options_.memory_limit_gb > 0.0 && 1e-9 * bytes > options_.memory_limit_gb) {
      watched_.was_over_memory = true;
      process::end_with_environment(entry_);
      return;
    }
    const bool has_news = find_news();
    silent_s_ = has_news ? 0.0 : silent_s_ + since_s;
    double idle_s = 0.0;
    std::map<pid_t, Idle> idle;
    for (const auto& [pid, usage] : all) {
      if (!is_rank_name(usage.name) && !(pid == child_ && options_.launcher != Launcher::srun)) continue;
      const std::uint64_t cpu_ns = calc_cpu_below(all, pid);
      const auto before = idle_.find(pid);
      const bool is_idle = !has_news && before != idle_.end() && before->second.cpu_ns == cpu_ns;
      idle[pid] = {cpu_ns, is_idle ? before->second.seconds + since_s : 0.0};
      idle_s = std::max(idle_s, idle[pid].seconds);
    }
    idle_ = std::move(idle);
    if (idle_s < options_.hang_s && silent_s_ < options_.silence_s) return;
    watched_.was_hung = true;
    watched_.still_s = std::max(idle_s, silent_s_);
    process::end_with_environment(entry_);
  }

  /// True if the log or the progress file has grown since the last call.
  bool find_news() {
    long long sizes = 0;
    for (const char* name : {store::kLogFile, store::kProgressFile}) {
      struct stat info {};
      if (::stat((options_.work / name).c_str(), &info) == 0) sizes += info.st_size;
    }
    const bool has_news = sizes != sizes_;
    sizes_ = sizes;
    return has_news;
  }

  struct Idle {
    std::uint64_t cpu_ns = 0;
    double seconds = 0.0;
  };

  const pid_t child_;
  const Options& options_;
  const std::string entry_;
  Watched watched_;
  double elapsed_s_ = 0.0, stopping_s_ = 0.0, look_s_ = 0.0, silent_s_ = 0.0;
  bool is_terminated_ = false;
  long long sizes_ = -1;
  std::map<pid_t, Idle> idle_;
};

}  // namespace

void take_signals() {
  const sigset_t set = make_signals();
  ::sigprocmask(SIG_BLOCK, &set, nullptr);
  ::signal(SIGPIPE, SIG_IGN);
  ::prctl(PR_SET_CHILD_SUBREAPER, 1);
}

Watched watch(pid_t child, const Options& options, const std::string& token) { return Watcher(child, options, token).run(); }

}  // namespace carillon::attempt
