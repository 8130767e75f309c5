// Method:     One thread: bury children, settle rows, claim and start, show, and sleep until a signal or a second has passed. Attempts live
// in
//             sessions of their own and outlive this process; rows and locks tell the next one all it has to know.
// Source:     docs/howto/when-jobs-die.md. Deviations: none.
#include "jobs/queue/run.hpp"

#include <fmt/core.h>
#include <signal.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <map>
#include <optional>
#include <set>

#include "jobs/attempt/attempt.hpp"
#include "jobs/attempt/processes.hpp"
#include "jobs/attempt/publish.hpp"
#include "jobs/outcome/outcome.hpp"
#include "jobs/process/process.hpp"
#include "jobs/queue/admission.hpp"
#include "jobs/queue/display.hpp"
#include "jobs/queue/needs.hpp"
#include "jobs/queue/repair.hpp"
#include "jobs/queue/settle.hpp"
#include "jobs/queue/spawn.hpp"
#include "jobs/registry/registry.hpp"
#include "jobs/store/files.hpp"
#include "jobs/store/identity.hpp"
#include "jobs/store/open_folder.hpp"

namespace carillon::queue {
namespace {

using registry::Job;
using registry::State;

constexpr std::size_t kMostCandidates = 256;
constexpr int kMostRounds = 3;       // of reading what new jobs need, before the next step uses it
constexpr double kDrawingHosts = 4;  // Smaller machines than so many drawings take give no job memory for them.
constexpr double kAskAgainS = 5.0, kDiskPatienceS = 2.0, kLostPatienceS = 60.0;

sigset_t make_signals() {
  sigset_t set;
  ::sigemptyset(&set);
  for (const int signal : {SIGTERM, SIGINT, SIGHUP, SIGCHLD}) ::sigaddset(&set, signal);
  return set;
}

class Runner {
 public:
  Runner(const store::Store& store, const RunOptions& options)
      : store_(store),
        options_(options),
        display_(options.json, options.quiet),
        registry_(registry::Registry::open(store, [&](const std::string& line) { display_.say(line); })) {}

  int run() {
    const sigset_t set = make_signals();
    ::sigprocmask(SIG_BLOCK, &set, nullptr);
    ::signal(SIGPIPE, SIG_IGN);
    for (bool is_first = true;; is_first = false) {
      try {
        const bool is_over = step(is_first);
        if (is_over) return exit_code_;
      } catch (const SystemError& error) {
        // A full disk passes; whatever else the registry cannot do ends this.
        if (!store::is_disk_full(store_.root(), error.what()) && !store::is_disk_full(store_.registry_folder())) throw;
        if (!is_disk_told_) display_.say(fmt::format("the disk or quota is full ({}); this goes on when there is room", error.what()));
        is_disk_told_ = true;
        if (stops_ > 0 && list_attempts().empty()) return exit_code_;
        pause(kDiskPatienceS);
        continue;
      }
      pause(1.0);
    }
  }

 private:
  /// One round; true when there is nothing left to do.
  bool step(bool is_first) {
    bury_children();
    for (const Job& job : settle(store_, registry_)) tell_end(job);
    std::vector<Job> jobs = list_open();
    release_lost(jobs);
    const bool has_ready = std::any_of(jobs.begin(), jobs.end(), [](const Job& job) { return job.state != State::running; });
    if (stops_ == 0 && has_ready) start_what_fits();
    start_claimed();
    if (has_ready) jobs = list_open();
    if (is_first) tell_adopted(jobs);
    ask_cancelled(jobs);
    display_.show(store_, jobs);
    is_disk_told_ = false;
    if (stops_ > 0) return list_attempts().empty();
    return jobs.empty() && children_.empty() && !options_.keep;
  }

  std::vector<Job> list_open() {
    std::vector<Job> jobs = registry_.list({State::queued, State::running, State::waiting});
    std::erase_if(jobs, [](const Job& job) { return job.engine != "local"; });
    return jobs;
  }

  void pause(double seconds) {
    const sigset_t set = make_signals();
    const timespec time{static_cast<time_t>(seconds), 0};
    const int signal = ::sigtimedwait(&set, nullptr, &time);
    if (signal != SIGTERM && signal != SIGINT && signal != SIGHUP) return;
    ++stops_;
    exit_code_ = 128 + signal;
    if (stops_ == 1)
      display_.say(fmt::format("stopping: {} running job{} save{} and go back into the queue; once more to end them now", children_.size(),
                               children_.size() == 1 ? "" : "s", children_.size() == 1 ? "s" : ""));
    for (const pid_t pid : list_attempts()) {
      // An attempt that was asked before ends at once by SIGTERM.
      ::kill(pid, SIGUSR1);
      if (stops_ > 1) ::kill(pid, SIGTERM);
    }
  }

  /// The attempts that this process started, and those whose starter is gone.
  std::vector<pid_t> list_attempts() {
    std::vector<pid_t> pids;
    for (const auto& [pid, job] : children_) pids.push_back(pid);
    for (const Job& job : registry_.list({State::running})) {
      const std::optional<outcome::Attempt> attempt = outcome::read_attempt(store_.work_folder(job.id));
      if (job.engine != "local" || !attempt || !is_attempt_of(job, attempt->process)) continue;
      const std::map<pid_t, attempt::Usage> self = attempt::find_below(attempt->process.pid);
      const auto usage = self.find(attempt->process.pid);
      if (usage == self.end() || children_.count(attempt->process.pid) > 0) continue;
      const auto parents = attempt::find_below(usage->second.parent);
      const auto parent = parents.find(usage->second.parent);
      if (parent == parents.end() || parent->second.name != "carillon") pids.push_back(attempt->process.pid);
    }
    return pids;
  }

  void bury_children() {
    int status = 0;
    for (pid_t pid = 0; (pid = ::waitpid(-1, &status, WNOHANG)) > 0;) {
      const auto child = children_.find(pid);
      if (child == children_.end()) continue;
      const Job job = child->second;
      children_.erase(child);
      needs_.erase(job.id.text());
      const int code = WIFSIGNALED(status) ? 128 + WTERMSIG(status) : WEXITSTATUS(status);
      const std::optional<Job> row = registry_.find(job.id);
      if (!row || row->state != State::running || row->token != job.token || code == attempt::kExitBusy || store_.has_bank(job.id))
        continue;
      // Starting: its row still names us, where it could not be told who was started.
      const Standing standing = find_standing(store_, *row);
      if (standing != Standing::unbegun && standing != Standing::starting) continue;
      settle_unbegun(store_, registry_, *row, code);
      if (const std::optional<Job> now = registry_.find(job.id)) tell_end(*now);
    }
  }

  void tell_end(const Job& job) {
    blocked_since_.erase(job.id.text());
    needs_.erase(job.id.text());
    display_.tell(registry::to_text(job.state), job, job.state == State::done ? find_warnings(job) : std::vector<std::string>());
  }

  /// They name the file that the job was submitted from.
  std::vector<std::string> find_warnings(const Job& job) const {
    const std::optional<store::Request> request = find_request(store_, registry_, job.id);
    return store::read_warnings(store_, job.id, request && !request->job_file.empty() ? request->job_file : "the job");
  }

  void tell_adopted(const std::vector<Job>& jobs) {
    for (const Job& job : jobs) {
      const bool is_ours = std::any_of(children_.begin(), children_.end(), [&](const auto& child) { return child.second.id == job.id; });
      if (job.state == State::running && !is_ours) display_.tell("adopt", job);
    }
  }

  /// Running jobs that somebody cancelled; SIGUSR1 may be sent again and again.
  void ask_cancelled(const std::vector<Job>& jobs) {
    const double now_s = process::find_boot_seconds();
    for (const Job& job : jobs) {
      if (job.state != State::running || !job.cancel_wanted) continue;
      double& asked_s = asked_s_.try_emplace(job.id.text(), -kAskAgainS).first->second;
      if (now_s - asked_s < kAskAgainS && now_s >= asked_s) continue;
      asked_s = now_s;
      const std::optional<outcome::Attempt> attempt = outcome::read_attempt(store_.work_folder(job.id));
      if (attempt && is_attempt_of(job, attempt->process)) ::kill(attempt->process.pid, SIGUSR1);
    }
  }

  Host find_room() const {
    Host host = base::find_host();
    if (options_.cores > 0) host.cores = std::min(host.cores, options_.cores);
    if (options_.memory_gb > 0.0) {
      host.total_gb = std::min(host.total_gb, options_.memory_gb / kMemoryShare);
    }
    return host;
  }

  /// What a running job was promised and what it holds.
  Admitted find_admitted(const Job& job) const {
    Admitted admitted{std::max(1, job.given.ranks), job.given.memory_gb, 0.0};
    if (const std::optional<outcome::Attempt> attempt = outcome::read_attempt(store_.work_folder(job.id));
        attempt && attempt->token == job.token) {
      for (const auto& [pid, usage] : attempt::find_below(attempt->process.pid))
        admitted.used_gb += 1e-9 * static_cast<double>(usage.resident_bytes);
    }
    return admitted;
  }

  double find_blocked_s(const Job& job, double now_s) {
    const auto since = blocked_since_.find(job.id.text());
    return since == blocked_since_.end() ? 0.0 : now_s - since->second;
  }

  const JobNeeds& find_job_needs(const Job& job) {
    const auto known = needs_.find(job.id.text());
    if (known != needs_.end()) {
      set_asked(known->second, job);
      return known->second;
    }
    JobNeeds needs = find_needs(store_, job);
    if (options_.has_pictures && base::find_host().total_gb > kDrawingHosts * attempt::kDrawGb) needs.need.least_gb = attempt::kDrawGb;
    if (needs.wants_prediction && !can_predict_) can_predict_ = attempt::can_predict();
    if (needs.wants_prediction) needs.wants_prediction = *can_predict_;
    return needs_.emplace(job.id.text(), needs).first->second;
  }

  void start_what_fits() {
    const Host host = find_room();
    const double now_s = process::find_boot_seconds();
    std::vector<std::pair<Job, double>> never;
    std::vector<Job> unknown;  // Their needs are read from files and from the solver, for which no transaction waits.
    const auto pick = [&](const std::vector<Job>& running, const std::vector<Job>& ready) {
      for (const Job& job : ready) {
        if (needs_.count(job.id.text()) == 0) unknown.push_back(job);
      }
      return unknown.empty() ? pick_jobs(host, now_s, running, ready, never) : std::vector<Job>();
    };
    for (int round = 0; round < kMostRounds; ++round) {
      const std::vector<Job> claimed = registry_.claim("local", process::find_self(), pick, kMostCandidates);
      claimed_.insert(claimed_.end(), claimed.begin(), claimed.end());
      if (unknown.empty()) break;
      for (const Job& job : unknown) find_job_needs(job);
      unknown.clear();
    }
    for (const auto& [job, memory_gb] : never) refuse(job, memory_gb, host);
  }

  /// A row that was claimed must be started, or given back: it is ours until then.
  void start_claimed() {
    while (!claimed_.empty()) {
      const Job job = claimed_.back();
      std::string refusal;
      try {
        if (stops_ == 0) start(job);
      } catch (const SystemError& error) {
        refusal = error.what();
      }
      if (stops_ > 0) give_back(job);
      if (!refusal.empty()) settle_unstarted(store_, registry_, job, refusal);
      claimed_.pop_back();
    }
  }

  void give_back(const Job& job) {
    registry_.update(job.id, [&](Job& row) {
      if (row.state != State::running || row.token != job.token) return false;
      row.state = State::queued;
      return true;
    });
  }

  /// Claimed by this process, neither started nor waiting to be: its end could not be written (a full disk).
  bool is_forgotten(const Job& job) const {
    const auto is_same = [&](const Job& other) { return other.id == job.id; };
    return process::is_self(job.worker) && std::none_of(claimed_.begin(), claimed_.end(), is_same) &&
           std::none_of(children_.begin(), children_.end(), [&](const auto& child) { return is_same(child.second); });
  }

  /// Rows that were claimed in another container or under another name of this machine, whose attempt never began.
  void release_lost(const std::vector<Job>& jobs) {
    const double now_s = process::find_boot_seconds();
    for (const Job& job : jobs) {
      const Standing standing = job.state == State::running ? find_standing(store_, job) : Standing::ended;
      if (standing == Standing::starting && is_forgotten(job)) give_back(job);
      if (standing != Standing::elsewhere) {
        lost_since_.erase(job.id.text());
      } else if (now_s - lost_since_.try_emplace(job.id.text(), now_s).first->second > kLostPatienceS) {
        give_back(job);
      }
    }
  }

  std::vector<Job> pick_jobs(const Host& host, double now_s, const std::vector<Job>& running, const std::vector<Job>& ready,
                             std::vector<std::pair<Job, double>>& never) {
    std::vector<Admitted> admitted;
    for (const Job& job : running) {
      if (job.engine == "local") admitted.push_back(find_admitted(job));
    }
    std::vector<Candidate> candidates;
    for (const Job& job : ready) {
      const JobNeeds& needs = find_job_needs(job);
      Candidate candidate{needs.need, find_blocked_s(job, now_s)};
      if (needs.wants_prediction) candidate.need = make_prediction_need(needs.need, host);
      candidates.push_back(candidate);
    }
    const std::vector<Ruling> rulings = choose(host, admitted, candidates);
    std::vector<Job> chosen;
    for (std::size_t i = 0; i < ready.size(); ++i) {
      Job job = ready[i];
      if (rulings[i].answer == Answer::never) never.emplace_back(job, rulings[i].memory_gb);
      if (rulings[i].answer == Answer::wait) blocked_since_.try_emplace(job.id.text(), now_s);
      if (rulings[i].answer != Answer::start) continue;
      job.given.ranks = rulings[i].ranks;
      job.given.memory_gb = rulings[i].memory_gb;
      job.reason = describe_ranks(candidates[i].need.ranks, job.given.ranks);
      chosen.push_back(job);
    }
    return chosen;
  }

  /// Why a job runs on fewer ranks than it asks for; empty when it does not.
  static std::string describe_ranks(int asked, int given) {
    return asked > given ? fmt::format("asks for {} ranks, and runs on {}: more cores there are not to use", asked, given) : "";
  }

  /// A prediction runs in a slot of its own: one rank, and memory for the mesh and what is assembled of it.
  static Need make_prediction_need(const Need& guess, const Host& host) {
    Need need;
    need.ranks = 1;
    need.memory_gb = std::min(calc_memory(guess, 1), 0.5 * kMemoryShare * host.total_gb);
    return need;
  }

  void refuse(const Job& job, double memory_gb, const Host& host) {
    const std::string reason =
        fmt::format("needs {:.2f} GB of memory, and this machine can give {:.2f} GB at most; use a coarser mesh or a larger machine",
                    memory_gb, kMemoryShare * host.total_gb);
    const bool is_changed = registry_.update(job.id, [&](Job& row) {
      if (row.state != State::queued && row.state != State::waiting) return false;
      row.state = State::failed;
      row.reason = reason;
      row.ended_unix_s = static_cast<double>(::time(nullptr));
      return true;
    });
    const std::optional<Job> now = registry_.find(job.id);
    if (is_changed && now) tell_end(*now);
  }

  void start(const Job& job) {
    const JobNeeds needs = find_job_needs(job);
    attempt::Options attempt;
    attempt.work = store_.work_folder(job.id);
    attempt.ranks = job.given.ranks;
    attempt.memory_gb = job.given.memory_gb;
    attempt.time_limit_s = needs.time_limit_s;
    attempt.token = job.token;
    attempt.is_prediction = needs.wants_prediction;
    attempt.mpirun_options = options_.mpirun_options;
    attempt.has_pictures = options_.has_pictures;
    blocked_since_.erase(job.id.text());
    asked_s_.erase(job.id.text());
    const store::OpenFolder work = store_.open_work(job.id);
    attempt::clear_way(work.path(), store::kLogFile);
    const pid_t pid = spawn(attempt::make_arguments(options_.program, attempt), work.path() / store::kLogFile);
    children_.emplace(pid, job);
    name_worker(job, pid);
    display_.tell(attempt.is_prediction ? "predict" : "start", job);
  }

  /// Until attempt.json tells, the row does. Where the disk is full it says less.
  void name_worker(const Job& job, pid_t pid) {
    const std::optional<process::Identity> child = process::find_process(pid);
    if (!child) return;
    try {
      registry_.update(job.id, [&](Job& row) {
        if (row.token != job.token) return false;
        row.worker = *child;
        return true;
      });
    } catch (const SystemError&) {
    }
  }

  const store::Store& store_;
  const RunOptions options_;
  Display display_;
  registry::Registry registry_;
  std::map<pid_t, Job> children_;
  std::map<std::string, JobNeeds> needs_;        // by id, until an attempt has ended
  std::map<std::string, double> blocked_since_;  // boot seconds
  std::map<std::string, double> lost_since_;
  std::map<std::string, double> asked_s_;
  std::vector<Job> claimed_;  // and not started yet
  std::optional<bool> can_predict_;
  int stops_ = 0;
  int exit_code_ = 0;
  bool is_disk_told_ = false;
};

}  // namespace

int run(const store::Store& store, const RunOptions& options) { return Runner(store, options).run(); }

}  // namespace carillon::queue
