// Method:     Lock the folder; end processes of the previous attempt; write attempt.json; publish an existing bank, else start the solver,
//             watch it, classify its end, verify and publish; write outcome.json last. docs/howto/jobs.md
#include <fmt/core.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <string>
#include <thread>

#include "jobs/queue/attempt/attempt.hpp"
#include "jobs/queue/attempt/launch.hpp"
#include "jobs/queue/attempt/processes.hpp"
#include "jobs/queue/attempt/publish.hpp"
#include "jobs/store/files.hpp"
#include "jobs/store/identity.hpp"
#include "jobs/store/order.hpp"
#include "jobs/store/outcome/outcome.hpp"
#include "jobs/store/outcome/policy.hpp"
#include "jobs/store/process/process.hpp"
#include "jobs/store/store.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/base/result.hpp"

namespace carillon::attempt {
namespace {

namespace fs = std::filesystem;
using outcome::Cause;

// Method:     One thread waits for signals with a timeout. To stop a job: SIGUSR1 ("save and stop"; mpirun forwards it and, unlike SIGTERM,
//             keeps the exit code of the ranks), repeated every ten seconds because mpirun loses it during startup; SIGTERM after the grace
//             period; SIGKILL to all processes with the attempt's token five seconds later. Hang: a rank used no CPU time while no process
//             wrote output (waiting ranks poll and use CPU time). Time is counted in short steps of the monotonic clock, so that suspending
//             the machine does not end a job.
// Source:     Open MPI 4.1 mpirun(1), signal forwarding; Linux prctl(2), sigtimedwait(2).

/// Observations until its end.
struct Watched {
  int exit_code = 0;  // 128 + signal if ended by a signal
  bool was_asked_to_stop = false;
  bool was_out_of_time = false;
  bool was_over_memory = false;  // killed above options.memory_limit_gb
  bool was_hung = false;
  double still_s = 0.0;         // was_hung: duration without output and CPU time
  double peak_memory_gb = 0.0;  // resident, `child` and all descendants
};

constexpr double kStepS = 0.5, kMaxStepS = 2.0, kLookS = 2.0, kAskAgainS = 10.0, kTermS = 5.0;
/// Names as truncated by the kernel.
bool is_rank_name(const std::string& name) { return name == "carillon-precom" || name == "carillon-simula"; }

sigset_t make_signals() {
  sigset_t set;
  ::sigemptyset(&set);
  for (const int signal : {SIGTERM, SIGINT, SIGHUP, SIGUSR1, SIGCHLD}) ::sigaddset(&set, signal);
  return set;
}

/// Ends the solver's remaining descendants. Orphans among them are children of this process, a subreaper.
void end_descendants(const std::string& entry) {
  while (::waitpid(-1, nullptr, WNOHANG) > 0) {
  }
  siginfo_t info{};
  if (::waitid(P_ALL, 0, &info, WEXITED | WNOHANG | WNOWAIT) != 0 && errno == ECHILD) return;
  process::end_with_environment(entry);
  while (::waitpid(-1, nullptr, WNOHANG) > 0) {
  }
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
    end_descendants(entry_);
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

/// Blocks the signals that watch() waits for, and makes this process a subreaper. Call before start().
void take_signals() {
  const sigset_t set = make_signals();
  ::sigprocmask(SIG_BLOCK, &set, nullptr);
  ::signal(SIGPIPE, SIG_IGN);
  ::prctl(PR_SET_CHILD_SUBREAPER, 1);
}

/// Waits for `child` (of start()), then kills remaining processes of the attempt.
Watched watch(pid_t child, const Options& options, const std::string& token) { return Watcher(child, options, token).run(); }

constexpr std::uintmax_t kMaxLogBytes = 1 << 16;
constexpr double kMaxDrawSeconds = 60.0;

fs::path find_root(const fs::path& work) {
  const fs::path root = work.parent_path().parent_path().parent_path();
  std::error_code error;
  if (!fs::is_regular_file(root / "VERSION", error) || work.parent_path().parent_path().filename() != "work")
    throw InputError(fmt::format("{}: not a folder of work; name work/ab/ID of a store", work.string()));
  return root;
}

/// Inode and time of a file: they change when it is written again. Zeros if it does not exist.
std::pair<long long, long long> find_mark(const fs::path& file) {
  struct stat info {};
  if (::stat(file.c_str(), &info) != 0) return {0, 0};
  return {static_cast<long long>(info.st_ino), info.st_mtim.tv_sec * 1000000000LL + info.st_mtim.tv_nsec};
}

std::string read_end(const fs::path& file, std::uintmax_t from) {
  std::error_code error;
  const std::uintmax_t size = fs::file_size(file, error);
  if (error || size <= from) return {};
  std::ifstream stream(file, std::ios::binary);
  stream.seekg(static_cast<std::streamoff>(std::max(from, size > kMaxLogBytes ? size - kMaxLogBytes : 0)));
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// The rank that mpirun reports as ended by a signal, "rank 1 on node3", for display only; empty if none.
std::string find_dead_rank(std::string_view log) {
  constexpr std::string_view kMark = "mpirun noticed that process ";
  const std::size_t at = log.rfind(kMark);
  if (at == std::string_view::npos) return {};
  const std::string_view rest = log.substr(at + kMark.size()), line = rest.substr(0, rest.find('\n'));
  const std::size_t pid = line.find(" with PID "), node = line.find(" on node ");
  if (pid == std::string_view::npos || node == std::string_view::npos) return {};
  const std::string_view host = line.substr(node + 9);
  return fmt::format("{} on {}", line.substr(0, pid), host.substr(0, host.find(' ')));
}

/// Pictures if requested and if the job has the memory to draw them.
report::Options find_report_options(const Options& attempt) {
  report::Options wanted;
  wanted.draw_limit_s = kMaxDrawSeconds;
  const bool has_room = attempt.memory_gb <= 0.0 || attempt.memory_gb >= kDrawGb;
  if (!attempt.has_pictures || !has_room) wanted.drawn_modes = 0;
  if (attempt.has_pictures && !has_room)
    wanted.undrawn_reason =
        fmt::format("drawing needs about {:g} GB, and the job had {:g}; carillon report JOB draws them", kDrawGb, attempt.memory_gb);
  return wanted;
}

/// Retries: other processes test the lock for short moments.
std::optional<process::Lock> take_lock(const fs::path& work) {
  for (int round = 0; round < 20; ++round) {
    if (std::optional<process::Lock> lock = process::Lock::take(work / "lock")) return lock;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  return std::nullopt;
}

class Attempt {
 public:
  Attempt(const Options& options, const store::Store& store, const store::Id& id)
      : options_(options), work_(store.work_folder(id)), store_(store), id_(id) {
    outcome_.token = options.token.empty() ? store::make_random_name() : options.token;
    outcome_.ranks = options.ranks;
    outcome_.host = process::find_host();
    outcome_.started = outcome::find_utc();
    options_.work = work_;
    // For child processes such as carillon-draw.
    ::setenv("CARILLON_ATTEMPT", outcome_.token.c_str(), 1);
  }

  int run() {
    take_signals();
    const double start_s = base::get_steady_s();
    const std::optional<outcome::Outcome> before = outcome::read_outcome(work_);
    try {
      clean();
      solve(before ? before->percent : 0.0);
    } catch (const SystemError& error) {
      set(store::is_disk_full(work_, error) ? Cause::disk_full : Cause::system, error.what());
    } catch (const InputError& error) {
      set(Cause::bad_input, error.what());
    } catch (const std::bad_alloc&) {
      set(Cause::memory, "out of memory while the bank was verified");
    } catch (const std::exception& error) {
      set(store::is_disk_full(work_, error) ? Cause::disk_full : Cause::system, error.what());
    }
    outcome_.seconds = base::get_steady_s() - start_s;
    outcome_.percent = std::max(outcome_.percent, before ? before->percent : 0.0);
    return finish();
  }

 private:
  void set(Cause cause, const std::string& reason, double need_gb = 0.0) {
    outcome_.cause = cause;
    outcome_.reason = reason;
    outcome_.memory_need_gb = need_gb;
  }

  /// Ends processes and removes files of the previous attempt, then writes attempt.json.
  void clean() {
    const std::optional<outcome::Attempt> before = outcome::read_attempt(work_);
    if (before) ranks_before_ = before->ranks;
    if (before && before->token != outcome_.token) {
      if (before->process.host == outcome_.host) process::end_with_environment("CARILLON_ATTEMPT=" + before->token);
      Scratch::remove_left(before->token);
    }
    remove_temporary_files();
    outcome::write_attempt(work_, {outcome_.token, process::find_self(), options_.ranks, options_.memory_gb, outcome_.started});
    make_reserve(work_);
  }

  /// Temporary files of killed writers.
  void remove_temporary_files() const {
    std::error_code error;
    for (fs::directory_iterator it(work_, error), end; !error && it != end; it.increment(error)) {
      const std::string name = it->path().filename().string();
      if (name.starts_with(".") && name.find(".tmp.") != std::string::npos) fs::remove(it->path(), error);
    }
  }

  /// Checks the job and every byte of its inputs against the id.
  store::Request check_inputs() {
    if (const auto fault = store::find_job_fault(store_, id_))
      throw InputError(*fault + "; submit the job again, or repair its folder with carillon verify --repair");
    const store::Request request = *store::read_request(work_);
    if (const auto fault = store::find_input_fault(store_, request))
      throw InputError(fmt::format("{}; submit the job again, which copies its {} again", *fault,
                                   request.inputs.empty() ? to_text(request.input_kind) : "meshes"));
    return request;
  }

  /// A checkpoint of a simulation can be resumed only on the same number of ranks.
  void drop_other_ranks() {
    std::error_code error;
    if (ranks_before_ == 0 || ranks_before_ == options_.ranks || !fs::exists(work_ / store::kCheckpointFile, error)) return;
    fs::remove(work_ / store::kCheckpointFile, error);
    store::append_text(work_ / store::kLogFile,
                       fmt::format("carillon attempt: the checkpoint has {} ranks and this attempt {}; it starts from the beginning\n",
                                   ranks_before_, options_.ranks));
  }

  void solve(double percent_before) {
    const store::Request request = check_inputs();
    options_.is_simulation = request.input_kind == store::InputKind::simulation;
    if (options_.is_simulation) drop_other_ranks();
    bool has_bank = false;
    if (!find_bank_fault(work_, request, has_bank)) {
      // A finished job always has a log.
      store::append_text(work_ / store::kLogFile,
                         fmt::format("carillon attempt: the {} was computed by an attempt that ended before publication\n",
                                     options_.is_simulation ? "simulation" : "bank"));
      return set(Cause::done, "");
    }
    if (has_bank) store::remove_tree(work_ / (options_.is_simulation ? store::kRecordFile : store::kBankFile));
    const fs::path log = work_ / store::kLogFile, checkpoint = work_ / store::kCheckpointFile;
    std::optional<Scratch> scratch;
    if (!is_under_slurm()) scratch.emplace(outcome_.token);
    std::optional<Launch> launch;
    try {
      launch = make_launch(options_, outcome_.token, scratch ? &*scratch : nullptr);
    } catch (const SystemError& error) {
      return set(Cause::no_program, error.what());
    }
    std::error_code error;
    const std::uintmax_t log_start = fs::file_size(log, error);
    const auto mark = find_mark(checkpoint);
    const std::uint64_t kills = find_memory_kills();
    const fs::path printed = options_.is_prediction ? work_ / "prediction.new" : fs::path();
    ::unlink((work_ / store::kResultFile).c_str());  // of an earlier attempt
    const Watched watched = watch(start(*launch, work_, log, printed, options_.solver), options_, outcome_.token);
    if (const std::optional<store::Progress> progress = store::read_progress(work_)) outcome_.percent = progress->percent;
    outcome_.exit_code = watched.exit_code;
    outcome_.peak_memory_gb = watched.peak_memory_gb;
    outcome::Ending ending{
        watched.exit_code, watched.was_asked_to_stop,   watched.was_out_of_time,    watched.was_hung,
        watched.still_s,   find_memory_kills() > kills, store::is_disk_full(work_), base::read_result(work_ / store::kResultFile)};
    ending.memory_limit_gb = options_.memory_limit_gb;
    if (watched.was_over_memory) ending.held_gb = watched.peak_memory_gb;
    ending.has_saved = find_mark(checkpoint) != mark && find_mark(checkpoint).first != 0;
    outcome_.is_further = outcome_.percent > percent_before && ending.has_saved;
    if (ending.exit_code != 0 && !ending.result) ending.dead_rank = find_dead_rank(read_end(log, error ? 0 : log_start));
    const outcome::FailureCause found = outcome::classify(ending);
    set(found.cause, found.reason, found.memory_need_gb);
    if (found.cause != Cause::done) return;
    if (options_.is_prediction) {
      fs::rename(printed, work_ / kPredictionFile);
      return set(Cause::predicted, "its needs are predicted; waits for resources");
    }
    if (const std::optional<std::string> fault = find_bank_fault(work_, request, has_bank))
      return set(Cause::bad_bank, "the solver exited with 0, but its result is unusable: " + *fault);
    if (const auto fault = store::find_input_fault(store_, request))
      set(Cause::bad_input, fmt::format("during the solve {}; submit the job again", *fault));
  }

  /// Publishes, or writes outcome.json; returns the exit code.
  int finish() {
    remove_reserve(work_);
    outcome_.ended = outcome::find_utc();
    if (outcome_.cause == Cause::done) {
      outcome_.percent = 100.0;
      try {
        publish(store_, id_, work_, outcome_, find_report_options(options_));
        end_descendants("CARILLON_ATTEMPT=" + outcome_.token);
        store_.remove_work(id_);
        return 0;
      } catch (const std::exception& error) {
        if (store_.has_bank(id_)) return 0;  // published; only the removal of the work failed
        set(store::is_disk_full(work_, error) ? Cause::disk_full : Cause::system, error.what());
      }
    }
    fmt::print(stderr, "carillon attempt: {}: {}\n", outcome::to_text(outcome_.cause), outcome_.reason);
    outcome::write_outcome(work_, outcome_);
    switch (outcome_.cause) {
      case Cause::bad_input:
        return kExitInput;
      case Cause::no_solution:
        return kExitSolve;
      case Cause::no_program:
        return kExitSystem;
      default:
        return kExitCheckpointed;
    }
  }

  Options options_;
  const fs::path work_;
  const store::Store& store_;
  const store::Id id_;
  int ranks_before_ = 0;  // of the previous attempt
  outcome::Outcome outcome_;
};

}  // namespace

int run_attempt(const Options& options) {
  fs::path work = fs::absolute(options.work).lexically_normal();
  if (!work.has_filename()) work = work.parent_path();
  const store::Store store = store::Store::open(find_root(work));
  const store::Id id = store::require_id(work.filename().string(), work.string());
  if (work != store.work_folder(id)) throw InputError(fmt::format("{}: not a folder of work; name work/ab/ID of a store", work.string()));
  // E.g. published and removed by another attempt.
  if (!store.has_work(id)) throw InputError(fmt::format("{}: no such folder of work", work.string()));
  const std::optional<process::Lock> lock = take_lock(work);
  if (!lock) {
    fmt::print(stderr, "{}: another attempt is running in this folder; nothing was done\n", work.string());
    return kExitBusy;
  }
  return Attempt(options, store, id).run();
}

}  // namespace carillon::attempt
