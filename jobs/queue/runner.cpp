// Method:     One thread: reap children, settle rows, claim and start jobs, update the display, wait for a signal or one second. Attempts
//             run in sessions of their own and outlive this process; rows and locks hold the complete state. docs/howto/jobs.md
#include "jobs/queue/runner.hpp"

#include <fmt/core.h>
#include <signal.h>

#include <algorithm>

#include "jobs/queue/attempt/attempt.hpp"
#include "jobs/queue/settle.hpp"
#include "runtime/base/error.hpp"

namespace carillon::queue {
namespace {

using registry::Job;
using registry::JobState;

constexpr std::size_t kMaxCandidates = 256;
constexpr int kMaxRounds = 3;  // of claims per step, while needs of new jobs are read
constexpr double kStepS = 1.0, kAskAgainS = 5.0, kDiskPatienceS = 2.0, kLostPatienceS = 60.0;

/// Resources of a prediction: one rank, and memory for mesh and matrices.
Need make_prediction_need(const Need& guess, const Host& host) {
  Need need;
  need.ranks = 1;
  need.memory_gb = std::min(calc_memory(guess, 1), 0.5 * kMemoryShare * host.total_gb);
  return need;
}

/// Why a job runs on fewer ranks than requested; empty if it does not.
std::string describe_ranks(int requested, int given) {
  return requested > given ? fmt::format("requested {} ranks, using {}: no more cores available", requested, given) : "";
}

}  // namespace

int Runner::run() {
  for (;;) {
    double wait_s = kStepS;
    try {
      if (step()) return find_exit_code();
    } catch (const SystemError& error) {
      // Wait only for a full disk.
      if (!at_.disk.is_full(&error)) throw;
      if (!is_disk_shown_)
        display_.print_note(fmt::format("the disk or quota is full ({}); the queue continues when space is free", error.what()));
      is_disk_shown_ = true;
      if (stops_ > 0 && list_attempts().empty()) return exit_code_;
      wait_s = kDiskPatienceS;
    }
    if (const int signal = at_.clock.wait(wait_s); signal != 0) stop(signal);
  }
}

/// From the rows: other processes may have settled them.
int Runner::find_exit_code() const {
  if (exit_code_ != 0) return exit_code_;
  const bool has_failed = std::any_of(worked_.begin(), worked_.end(), [&](const store::Id& id) {
    const std::optional<Job> job = table_.find(id);
    return job && (job->state == JobState::failed || job->state == JobState::cancelled);
  });
  return has_failed ? kExitSolve : 0;
}

bool Runner::step() {
  const bool is_first = std::exchange(is_first_step_, false);
  reap_children();
  for (const Job& job : settle(at_, table_)) show_end(job);
  std::vector<Job> jobs = table_.list_open(store::JobEngine::local);
  for (const Job& job : jobs) worked_.insert(job.id);
  release_lost(jobs);
  const bool has_ready = std::any_of(jobs.begin(), jobs.end(), [](const Job& job) { return job.state != JobState::running; });
  if (stops_ == 0 && has_ready) start_what_fits();
  start_claimed();
  if (has_ready) jobs = table_.list_open(store::JobEngine::local);
  for (const Job& job : jobs) worked_.insert(job.id);
  if (is_first) show_adopted(jobs);
  ask_cancelled(jobs);
  display_.show(jobs);
  is_disk_shown_ = false;
  if (stops_ > 0) return list_attempts().empty();
  return jobs.empty() && children_.empty() && !options_.keep;
}

void Runner::stop(int signal) {
  ++stops_;
  exit_code_ = 128 + signal;
  if (stops_ == 1)
    display_.print_note(fmt::format("stopping: {} running job{} save{} and return to the queue; again to end them now", children_.size(),
                                    children_.size() == 1 ? "" : "s", children_.size() == 1 ? "s" : ""));
  for (const pid_t pid : list_attempts()) {
    // SIGTERM after SIGUSR1 ends an attempt at once.
    at_.launcher.send_signal(pid, SIGUSR1);
    if (stops_ > 1) at_.launcher.send_signal(pid, SIGTERM);
  }
}

void Runner::reap_children() {
  while (const std::optional<EndedChild> ended = at_.launcher.reap_child()) {
    const auto child = children_.find(ended->pid);
    if (child == children_.end()) continue;
    const Job job = child->second;
    children_.erase(child);
    needs_.erase(job.id);
    const std::optional<Job> row = table_.find(job.id);
    const bool is_other = !row || row->state != JobState::running || row->token != job.token;
    if (is_other || ended->exit_code == attempt::kExitBusy || at_.disk.has_bank(job.id)) continue;
    // starting: name_worker() could not write the child's identity.
    const AttemptState state = find_attempt_state(at_, *row);
    if (state != AttemptState::not_begun && state != AttemptState::starting) continue;
    settle_not_begun(at_, table_, *row, ended->exit_code);
    if (const std::optional<Job> now = table_.find(job.id)) show_end(*now);
  }
}

void Runner::show_end(const Job& job) {
  blocked_since_.erase(job.id);
  needs_.erase(job.id);
  display_.print_event(registry::to_text(job.state), job);
}

void Runner::show_adopted(const std::vector<Job>& jobs) {
  for (const Job& job : jobs) {
    const bool is_ours = std::any_of(children_.begin(), children_.end(), [&](const auto& child) { return child.second.id == job.id; });
    if (job.state == JobState::running && !is_ours) display_.print_event("adopt", job);
  }
}

/// Attempts of this process, and orphans.
std::vector<pid_t> Runner::list_attempts() const {
  std::vector<pid_t> pids;
  for (const auto& [pid, job] : children_) pids.push_back(pid);
  for (const Job& job : table_.list({JobState::running})) {
    const std::optional<outcome::Attempt> attempt = at_.disk.read_attempt(job.id);
    if (job.engine != store::JobEngine::local || !attempt || children_.count(attempt->process.pid) > 0) continue;
    if (at_.launcher.is_attempt_of(job, attempt->process) && at_.launcher.is_orphan(attempt->process.pid))
      pids.push_back(attempt->process.pid);
  }
  return pids;
}

/// Asks running jobs with cancel_wanted to stop, repeatedly.
void Runner::ask_cancelled(const std::vector<Job>& jobs) {
  const double now_s = at_.clock.get_boot_s();
  for (const Job& job : jobs) {
    if (job.state != JobState::running || !job.cancel_wanted) continue;
    double& asked_s = asked_s_.try_emplace(job.id, -kAskAgainS).first->second;
    if (now_s - asked_s < kAskAgainS && now_s >= asked_s) continue;
    asked_s = now_s;
    ask_to_stop(at_, job);
  }
}

Host Runner::find_room() const {
  Host host = at_.launcher.find_host();
  if (options_.cores > 0) host.cores = std::min(host.cores, options_.cores);
  if (options_.memory_gb > 0.0) host.total_gb = std::min(host.total_gb, options_.memory_gb / kMemoryShare);
  return host;
}

/// Admitted and current resources of a running job.
Admitted Runner::find_admitted(const Job& job) const {
  const std::optional<outcome::Attempt> attempt = at_.disk.read_attempt(job.id);
  const bool has_begun = attempt && attempt->token == job.token;
  return {std::max(1, job.given.ranks), job.given.memory_gb, has_begun ? at_.launcher.find_used_gb(attempt->process.pid) : 0.0};
}

const JobNeeds& Runner::find_needs(const Job& job) {
  const auto known = needs_.find(job.id);
  if (known == needs_.end()) return needs_.emplace(job.id, calc_needs_(job)).first->second;
  set_asked(known->second, job);
  return known->second;
}

void Runner::start_what_fits() {
  const Host host = find_room();
  const double now_s = at_.clock.get_boot_s();
  std::vector<std::pair<Job, double>> never;
  std::vector<Job> unknown;  // needs are read outside the transaction
  const auto pick = [&](const std::vector<Job>& running, const std::vector<Job>& ready) {
    for (const Job& job : ready) {
      if (needs_.count(job.id) == 0) unknown.push_back(job);
    }
    return unknown.empty() ? pick_jobs(host, now_s, running, ready, never) : std::vector<Job>();
  };
  for (int round = 0; round < kMaxRounds; ++round) {
    const std::vector<Job> claimed = table_.claim(store::JobEngine::local, *at_.launcher.find_process(0), pick, kMaxCandidates);
    claimed_.insert(claimed_.end(), claimed.begin(), claimed.end());
    if (unknown.empty()) break;
    for (const Job& job : unknown) find_needs(job);
    unknown.clear();
  }
  for (const auto& [job, memory_gb] : never) refuse(job, memory_gb, host);
}

std::vector<Job> Runner::pick_jobs(const Host& host, double now_s, const std::vector<Job>& running, const std::vector<Job>& ready,
                                   std::vector<std::pair<Job, double>>& never) {
  std::vector<Admitted> admitted;
  for (const Job& job : running) {
    if (job.engine == store::JobEngine::local) admitted.push_back(find_admitted(job));
  }
  std::vector<Candidate> candidates;
  for (const Job& job : ready) {
    const JobNeeds& needs = find_needs(job);
    const auto since = blocked_since_.find(job.id);
    Candidate candidate{needs.need, since == blocked_since_.end() ? 0.0 : now_s - since->second};
    if (needs.wants_prediction) candidate.need = make_prediction_need(needs.need, host);
    candidates.push_back(candidate);
  }
  const std::vector<Admission> admissions = choose(host, admitted, candidates);
  std::vector<Job> chosen;
  for (std::size_t i = 0; i < ready.size(); ++i) {
    Job job = ready[i];
    if (admissions[i].decision == Admission::Decision::never) never.emplace_back(job, admissions[i].memory_gb);
    if (admissions[i].decision == Admission::Decision::wait) blocked_since_.try_emplace(job.id, now_s);
    if (admissions[i].decision != Admission::Decision::start) continue;
    job.given.ranks = admissions[i].ranks;
    job.given.memory_gb = admissions[i].memory_gb;
    job.reason = describe_ranks(candidates[i].need.ranks, job.given.ranks);
    chosen.push_back(job);
  }
  return chosen;
}

void Runner::refuse(const Job& job, double memory_gb, const Host& host) {
  const std::string reason =
      fmt::format("needs {:.2f} GB of memory, and this machine has {:.2f} GB for jobs; use a coarser mesh or a larger machine", memory_gb,
                  kMemoryShare * host.total_gb);
  const bool is_changed = table_.update(job.id, [&](Job& row) {
    if (row.state != JobState::queued && row.state != JobState::waiting) return false;
    end(row, JobState::failed, reason);
    return true;
  });
  const std::optional<Job> now = table_.find(job.id);
  if (is_changed && now) show_end(*now);
}

/// Starts every claimed row or gives it back.
void Runner::start_claimed() {
  while (!claimed_.empty()) {
    const Job job = claimed_.back();
    try {
      if (stops_ == 0) start(job);
    } catch (const SystemError& error) {
      settle_not_started(at_, table_, job, error);
    }
    if (stops_ > 0) give_back(job);
    claimed_.pop_back();
  }
}

void Runner::start(const Job& job) {
  const JobNeeds needs = find_needs(job);
  blocked_since_.erase(job.id);
  asked_s_.erase(job.id);
  const pid_t pid = at_.launcher.start(job, {needs.time_limit_s, needs.wants_prediction, needs.is_simulation});
  children_.emplace(pid, job);
  name_worker(job, pid);
  display_.print_event(needs.wants_prediction ? "predict" : "start", job);
}

/// Writes the process of the attempt to its row. Best effort on a full disk.
void Runner::name_worker(const Job& job, pid_t pid) {
  const std::optional<process::Identity> child = at_.launcher.find_process(pid);
  if (!child) return;
  try {
    table_.update(job.id, [&](Job& row) {
      if (row.token != job.token) return false;
      row.worker = *child;
      return true;
    });
  } catch (const SystemError&) {
  }
}

void Runner::give_back(const Job& job) {
  change_running(table_, job, [](Job& row) { row.state = JobState::queued; });
}

/// A row claimed by this process that is in neither list: its end could not be written (full disk).
bool Runner::is_forgotten(const Job& job) const {
  const auto is_same = [&](const Job& other) { return other.id == job.id; };
  const process::Identity self = *at_.launcher.find_process(0);
  const bool is_own = job.worker.pid == self.pid && job.worker.start_ticks == self.start_ticks && job.worker.boot == self.boot;
  return is_own && std::none_of(claimed_.begin(), claimed_.end(), is_same) &&
         std::none_of(children_.begin(), children_.end(), [&](const auto& child) { return is_same(child.second); });
}

/// Gives back rows claimed elsewhere (another container or host name) whose attempt never began.
void Runner::release_lost(const std::vector<Job>& jobs) {
  const double now_s = at_.clock.get_boot_s();
  for (const Job& job : jobs) {
    const AttemptState state = job.state == JobState::running ? find_attempt_state(at_, job) : AttemptState::ended;
    if (state == AttemptState::starting && is_forgotten(job)) give_back(job);
    if (state != AttemptState::elsewhere) {
      lost_since_.erase(job.id);
    } else if (now_s - lost_since_.try_emplace(job.id, now_s).first->second > kLostPatienceS) {
      give_back(job);
    }
  }
}

}  // namespace carillon::queue
