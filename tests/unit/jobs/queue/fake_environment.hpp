// Store, machine and clock in memory, with attempts controlled by the test.
#pragma once

#include <fmt/core.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <deque>
#include <functional>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "jobs/queue/attempt/attempt.hpp"
#include "jobs/queue/environment.hpp"
#include "runtime/base/failure.hpp"

namespace carillon::tests {

using outcome::Cause;
using registry::Job;
using registry::JobState;

/// Rows in a list, with the claim rule of the registry. No changes on a full disk.
class MemoryTable final : public registry::JobTable {
 public:
  MemoryTable(const queue::Clock& clock, std::function<bool(const store::Id&)> has_bank) : clock_(clock), has_bank_(std::move(has_bank)) {}

  void add(Job job) { rows_.push_back(std::move(job)); }
  const std::vector<Job>& rows() const { return rows_; }

  std::optional<Job> find(const store::Id& id) const override {
    const auto row = std::find_if(rows_.begin(), rows_.end(), [&](const Job& job) { return job.id == id; });
    return row == rows_.end() ? std::nullopt : std::optional(*row);
  }
  std::vector<Job> list(const std::vector<JobState>& states) const override {
    std::vector<Job> found;
    for (const Job& job : rows_) {
      if (states.empty() || std::find(states.begin(), states.end(), job.state) != states.end()) found.push_back(job);
    }
    return found;
  }
  std::vector<Job> claim(store::JobEngine engine, const process::Identity& worker, const Choose& choose, std::size_t max) override {
    require_room();
    const registry::ClaimTerms terms{engine, worker, max, clock_.get_boot_s(), clock_.get_boot_id(), has_bank_};
    std::vector<Job> changed = registry::calc_claims(list({JobState::queued, JobState::waiting, JobState::running}), terms, choose);
    for (const Job& job : changed) update(job.id, [&](Job& row) { return row = job, true; });
    std::erase_if(changed, [](const Job& job) { return job.state != JobState::running; });
    return changed;
  }
  bool update(const store::Id& id, const std::function<bool(Job&)>& change) override {
    require_room();
    for (Job& row : rows_) {
      if (row.id != id) continue;
      Job copy = row;
      if (!change(copy)) return false;
      if (is_open(row.state) && !is_open(copy.state)) ++ends_[id];
      row = copy;
      return true;
    }
    return false;
  }
  /// Number of ends of the row.
  int count_ends(const store::Id& id) const { return ends_.count(id) > 0 ? ends_.at(id) : 0; }

  bool is_disk_full = false;

 private:
  void require_room() const {
    if (is_disk_full) throw DiskFullError("the disk is full");
  }

  const queue::Clock& clock_;
  const std::function<bool(const store::Id&)> has_bank_;
  std::vector<Job> rows_;
  std::map<store::Id, int> ends_;
};

/// SIGKILL of a runner within a round.
struct RunnerDied {};

/// The process of an attempt, running from begin().
struct Process {
  pid_t pid = 0;
  store::Id job;
  std::string token;
  int ranks = 0;
  double memory_gb = 0.0;
  bool has_begun = false;  // holds the lock and has written attempt.json
  bool was_asked = false;  // to save and stop
  bool is_alive = true;
  pid_t parent = 0;  // the runner that started it; 0: an orphan
};

/// The environment of one or more runners, each with its own Launcher.
class World final : public queue::Disk, public queue::Clock {
 public:
  static constexpr int kCores = 4;
  static constexpr double kMemoryGb = 8.0;

  // Disk
  bool has_bank(const store::Id& id) const override { return banks_.count(id) > 0; }
  bool is_locked(const store::Id& id) const override {
    return std::any_of(processes_.begin(), processes_.end(), [&](const Process& p) { return p.job == id && p.is_alive && p.has_begun; });
  }
  std::optional<outcome::Attempt> read_attempt(const store::Id& id) const override { return find(attempts_, id); }
  std::optional<outcome::Outcome> read_outcome(const store::Id& id) const override { return find(outcomes_, id); }
  /// Fails every second time.
  void remove_work(const store::Id& id) override {
    if (++removals_ % 2 == 0) throw SystemError("the folder is in use");
    attempts_.erase(id);
    outcomes_.erase(id);
  }
  bool is_full(const std::exception*) const override { return is_disk_full; }

  // Clock
  double get_boot_s() const override { return now_s_; }
  std::string get_boot_id() const override { return "boot"; }
  int wait(double seconds) override { return now_s_ += seconds, 0; }

  pid_t start(const Job& job, pid_t parent) {
    if (const auto act = std::exchange(at_next_start, {})) act();
    if (refuses_to_start) throw SystemError("no more processes");
    processes_.push_back({next_pid_++, job.id, job.token, job.given.ranks, job.given.memory_gb, false, false, true, parent});
    return processes_.back().pid;
  }

  // Actions of attempts.
  /// The attempt takes the lock, or ends if it is held.
  void begin(Process& process) {
    if (has_bank(process.job)) return end(process, kExitInput);  // its folder of work is gone
    if (is_locked(process.job)) return end(process, attempt::kExitBusy);
    process.has_begun = true;
    outcome::Attempt attempt;
    attempt.token = process.token;
    attempt.process = identify(process.pid);
    attempts_.insert_or_assign(process.job, attempt);
  }
  /// Ends with this cause; done publishes the bank.
  void finish(Process& process, Cause cause) {
    if (cause == Cause::done) {
      ++published_[process.job];
      banks_.insert(process.job);
    } else {
      outcome::Outcome outcome;
      outcome.token = process.token;
      outcome.cause = cause;
      outcome.reason = "as the test says";
      outcomes_.insert_or_assign(process.job, outcome);
    }
    end(process, cause == Cause::done ? 0 : 85);
  }
  /// SIGKILL.
  void kill(Process& process) { end(process, 128 + SIGKILL); }

  std::vector<Process*> list_alive() {
    std::vector<Process*> alive;
    for (Process& process : processes_) {
      if (process.is_alive) alive.push_back(&process);
    }
    return alive;
  }
  Process* find_process(pid_t pid) {
    const auto found = std::find_if(processes_.begin(), processes_.end(), [&](const Process& p) { return p.pid == pid; });
    return found == processes_.end() ? nullptr : &*found;
  }
  static process::Identity identify(pid_t pid) { return {"host", "boot", pid, static_cast<std::uint64_t>(pid)}; }
  int count_published(const store::Id& id) const { return published_.count(id) > 0 ? published_.at(id) : 0; }
  /// The runner is killed; its attempts continue.
  void orphan_children(pid_t runner) {
    runners_.erase(runner);
    for (Process& process : processes_) {
      if (process.parent == runner) process.parent = 0;
    }
    ended_.erase(runner);
  }

  std::set<pid_t> runners_;
  std::map<pid_t, std::deque<queue::EndedChild>> ended_;  // by runner
  bool is_disk_full = false, refuses_to_start = false;
  std::function<void()> at_next_start;  // called between claim and start
  pid_t next_pid_ = 1000;

 private:
  template <class Value>
  static std::optional<Value> find(const std::map<store::Id, Value>& values, const store::Id& id) {
    const auto found = values.find(id);
    return found == values.end() ? std::nullopt : std::optional(found->second);
  }
  void end(Process& process, int exit_code) {
    process.is_alive = false;
    if (process.parent != 0) ended_[process.parent].push_back({process.pid, exit_code});
  }

  double now_s_ = 1000.0;
  std::deque<Process> processes_;
  std::set<store::Id> banks_;
  std::map<store::Id, int> published_;
  int removals_ = 0;
  std::map<store::Id, outcome::Attempt> attempts_;
  std::map<store::Id, outcome::Outcome> outcomes_;
};

class FakeLauncher final : public queue::Launcher {
 public:
  explicit FakeLauncher(World& world) : world_(world), self_(world.next_pid_++) { world_.runners_.insert(self_); }
  pid_t self() const { return self_; }

  pid_t start(const Job& job, const queue::StartOptions&) override { return world_.start(job, self_); }
  std::optional<queue::EndedChild> reap_child() override {
    auto& ended = world_.ended_[self_];
    if (ended.empty()) return std::nullopt;
    const queue::EndedChild child = ended.front();
    ended.pop_front();
    return child;
  }
  bool send_signal(pid_t pid, int signal) override {
    Process* process = world_.find_process(pid);
    if (process == nullptr || !process->is_alive) return false;
    process->was_asked = true;
    if (signal == SIGTERM && process->has_begun) world_.finish(*process, Cause::stopped);
    return true;
  }
  std::optional<process::Identity> find_process(pid_t pid) const override {
    if (pid == 0) return World::identify(self_);
    const Process* process = world_.find_process(pid);
    return process != nullptr && process->is_alive ? std::optional(World::identify(pid)) : std::nullopt;
  }
  process::Life find_life(const process::Identity& identity) const override {
    const Process* process = world_.find_process(identity.pid);
    const bool is_alive = (process != nullptr && process->is_alive) || world_.runners_.count(identity.pid) > 0;
    return is_alive ? process::Life::running : process::Life::gone;
  }
  bool is_attempt_of(const Job& job, const process::Identity& found) const override {
    const Process* process = world_.find_process(found.pid);
    return process != nullptr && process->is_alive && process->token == job.token;
  }
  bool is_orphan(pid_t attempt) const override { return world_.find_process(attempt)->parent == 0; }
  double find_used_gb(pid_t pid) const override {
    const Process* process = world_.find_process(pid);
    return process != nullptr && process->is_alive ? process->memory_gb : 0.0;
  }
  base::Host find_host() const override {
    double used_gb = 0.0;
    for (const Process* process : world_.list_alive()) used_gb += process->has_begun ? process->memory_gb : 0.0;
    return {World::kCores, World::kMemoryGb, World::kMemoryGb - used_gb};
  }

 private:
  World& world_;
  const pid_t self_;
};

}  // namespace carillon::tests
