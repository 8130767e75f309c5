// Source:     Linux sigtimedwait(2); sbatch(1), --signal.
#include "jobs/queue/slurm/task.hpp"

#include <fmt/core.h>
#include <signal.h>
#include <time.h>

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <map>
#include <optional>
#include <set>

#include "jobs/queue/attempt/attempt.hpp"
#include "jobs/queue/local.hpp"
#include "jobs/queue/slurm/client.hpp"
#include "jobs/queue/slurm/inside.hpp"
#include "jobs/store/files.hpp"
#include "jobs/store/outcome/outcome.hpp"
#include "jobs/store/outcome/policy.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/base/command.hpp"

namespace carillon::slurm {
namespace {

namespace fs = std::filesystem;
using outcome::Cause;

constexpr double kStepS = 0.5;
constexpr double kLookS = 1.0;  // interval of checks for cancelled jobs
constexpr double kBusyPatienceS = 120.0;

sigset_t make_signals() {
  sigset_t set;
  ::sigemptyset(&set);
  for (const int signal : {SIGTERM, SIGINT, SIGHUP, SIGUSR1, SIGCHLD}) ::sigaddset(&set, signal);
  return set;
}

/// State of one task.
class TaskRunner {
 public:
  TaskRunner(const TaskOptions& options, const store::Store& store, const TaskList& list)
      : options_(options),
        store_(store),
        list_(list),
        launcher_(store, {base::find_self(), options.has_pictures, options.mpirun_options}),
        room_{list.cores, list.memory_gb > 0.0 ? list.memory_gb : std::numeric_limits<double>::infinity()} {
    for (const TaskJob& job : list.jobs) waiting_.push_back(job.placed);
  }

  int run() {
    const sigset_t signals = make_signals();
    ::sigprocmask(SIG_BLOCK, &signals, nullptr);
    ::signal(SIGPIPE, SIG_IGN);
    double looked_s = base::get_steady_s();
    for (;;) {
      reap();
      if (!is_stopping_) start_ready();
      if (running_.empty() && (waiting_.empty() || is_stopping_)) break;
      handle(wait_for_signal());
      if (base::get_steady_s() - looked_s < kLookS) continue;
      looked_s = base::get_steady_s();
      stop_unwanted();
    }
    return finish();
  }

 private:
  const TaskJob& job_of(const Placed& placed) const { return list_.jobs[placed.job]; }

  /// True if this task has to run the job.
  bool is_wanted(const TaskJob& job) const {
    if (!store_.has_work(job.id)) return false;
    const std::optional<SubmittedJob> submitted = read_submitted_job(store_.work_folder(job.id));
    return submitted && submitted->batch == options_.batch && submitted->task == options_.task && !submitted->is_unwanted &&
           find_packed_state(store_, job.id, *submitted) != PackedState::ended;
  }

  static int wait_for_signal() {
    const sigset_t set = make_signals();
    const timespec step{0, static_cast<long>(kStepS * 1e9)};
    return ::sigtimedwait(&set, nullptr, &step);
  }

  void handle(int signal) {
    if (signal != SIGTERM && signal != SIGINT && signal != SIGHUP && signal != SIGUSR1) return;
    const bool is_again = is_stopping_ && signal != SIGUSR1;
    is_stopping_ = true;
    for (const auto& [pid, placed] : running_) launcher_.send_signal(pid, is_again ? SIGTERM : SIGUSR1);
  }

  void start_ready() {
    while (const std::optional<std::size_t> next = choose_next(waiting_, room_)) {
      const Placed placed = waiting_[*next];
      waiting_.erase(waiting_.begin() + static_cast<std::ptrdiff_t>(*next));
      if (is_wanted(job_of(placed))) start(placed);
    }
    if (running_.empty() && !waiting_.empty()) {  // larger than the task: run it alone
      const Placed placed = waiting_.front();
      waiting_.erase(waiting_.begin());
      if (is_wanted(job_of(placed))) start(placed);
    }
  }

  void start(const Placed& placed) {
    const TaskJob& job = job_of(placed);
    registry::Job row{.id = job.id};
    row.given.ranks = placed.ranks;
    row.given.memory_gb = placed.memory_gb;
    row.token = store::make_random_name();
    queue::StartOptions start;
    start.time_limit_s = job.time_limit_s;
    start.signal_at_end = SIGTERM;
    try {
      running_.emplace(launcher_.start(row, start), placed);
      room_.cores -= placed.ranks;
      room_.memory_gb -= placed.memory_gb;
      if (!has_begun_) write_begun(options_.root, options_.batch, options_.task);
      has_begun_ = true;
    } catch (const SystemError& error) {
      fmt::print(stderr, "carillon task: {}: {}\n", job.id.short_text(), error.what());
      exit_code_ = kExitSystem;
    }
  }

  void reap() {
    while (const std::optional<queue::EndedChild> ended = launcher_.reap_child()) {
      const auto found = running_.find(ended->pid);
      if (found == running_.end()) continue;
      const Placed placed = found->second;
      running_.erase(found);
      asked_.erase(ended->pid);
      room_.cores += placed.ranks;
      room_.memory_gb += placed.memory_gb;
      // Retry while a stopping attempt holds the lock of the folder.
      const double now_s = base::get_steady_s();
      if (ended->exit_code == attempt::kExitBusy && now_s - busy_since_s_.try_emplace(placed.job, now_s).first->second < kBusyPatienceS)
        waiting_.push_back(placed);
    }
  }

  void stop_unwanted() {
    for (const auto& [pid, placed] : running_) {
      const std::optional<SubmittedJob> submitted = read_submitted_job(store_.work_folder(job_of(placed).id));
      // Missing too when the job is done.
      const bool is_ours = submitted && submitted->batch == options_.batch && !submitted->is_unwanted;
      if (!is_ours && asked_.insert(pid).second) launcher_.send_signal(pid, SIGUSR1);
    }
  }

  /// True if a job stopped before the time limit shall continue; counts attempts without progress.
  bool keep_stopped(const TaskJob& job) const {
    if (!is_wanted(job)) return false;
    const fs::path work = store_.work_folder(job.id);
    const std::optional<outcome::Outcome> left = outcome::read_outcome(work);
    if (!left || (left->cause != Cause::stopped && left->cause != Cause::checkpointed)) return true;
    const outcome::Outcome explained = explain_stop(*left);
    const outcome::RetryDecision decision = outcome::decide(explained.cause, read_failures(work), explained.is_further);
    if (decision.next == outcome::Next::failed) {
      outcome::write_outcome(work, explained);
      return false;
    }
    write_failures(work, decision.failures);
    store::append_text(work / store::kLogFile, "carillon: " + explained.reason + "; queued again in Slurm\n");
    return true;
  }

  int finish() {
    if (!is_stopping_) return exit_code_;
    const auto left = std::count_if(list_.jobs.begin(), list_.jobs.end(), [&](const TaskJob& job) { return keep_stopped(job); });
    if (left == 0) return exit_code_;
    const char* number = std::getenv("SLURM_JOB_ID");
    if (number == nullptr) return kExitCheckpointed;
    try {
      const SlurmClient client{queue::SlurmSettings{}};
      if (client.is_running(number)) client.requeue(number, 0.0);
    } catch (const SystemError& error) {
      fmt::print(stderr, "carillon task: {}\n", error.what());
    }
    return kExitCheckpointed;
  }

  const TaskOptions& options_;
  const store::Store& store_;
  const TaskList& list_;
  queue::LocalLauncher launcher_;
  Room room_;
  std::vector<Placed> waiting_;
  std::map<pid_t, Placed> running_;
  std::set<pid_t> asked_;  // asked to stop
  std::map<std::size_t, double> busy_since_s_;
  bool is_stopping_ = false, has_begun_ = false;
  int exit_code_ = 0;
};

}  // namespace

PackedState find_packed_state(const store::Store& store, const store::Id& id, const SubmittedJob& submitted) {
  if (store.has_bank(id)) return PackedState::ended;
  const fs::path work = store.work_folder(id);
  const std::optional<outcome::Attempt> attempt = outcome::read_attempt(work);
  if (!attempt || attempt->token == submitted.before) return PackedState::waits;
  const std::optional<outcome::Outcome> left = outcome::read_outcome(work);
  if (!left || left->token != attempt->token) return PackedState::runs;
  return left->cause == Cause::stopped || left->cause == Cause::checkpointed ? PackedState::stopped : PackedState::ended;
}

int run_task(const TaskOptions& options) {
  const store::Store store = store::Store::open(options.root);
  const std::optional<TaskList> list = read_task(store.root(), options.batch, options.task);
  if (!list)
    throw InputError(fmt::format("{}: batch {} has no readable list for task {}; its jobs may have ended: carillon status",
                                 options.root.string(), options.batch, options.task));
  return TaskRunner(options, store, *list).run();
}

}  // namespace carillon::slurm
