// Method:     A running attempt holds the lock of its folder, which the kernel releases at its end; attempt.json shows whether the claimed
//             attempt began. Wall clocks are not used. Every change is a transaction that checks the row again.
//             docs/howto/jobs.md
#include "jobs/queue/settle.hpp"

#include <fmt/core.h>
#include <signal.h>

#include <optional>

#include "jobs/queue/repair.hpp"
#include "jobs/store/outcome/policy.hpp"

namespace carillon::queue {
namespace {

using registry::Job;
using registry::JobState;

/// The end of the attempt of this row.
outcome::Outcome find_outcome(const Disk& disk, const Job& job) {
  if (std::optional<outcome::Outcome> outcome = disk.read_outcome(job.id); outcome && outcome->token == job.token) return *outcome;
  outcome::Outcome outcome = outcome::make_killed(job.token);
  if (disk.is_full(nullptr)) {
    outcome.cause = outcome::Cause::disk_full;
    outcome.reason = "the disk of the store is full, and the outcome of the attempt could not be written";
  }
  return outcome;
}

}  // namespace

void end(Job& job, JobState state, const std::string& reason) {
  job.state = state;
  job.reason = reason;
  job.cancel_wanted = false;
  job.ended_unix_s = registry::find_unix_seconds();
}

void wait(Job& job, double delay_s, const std::string& reason, const Clock& clock) {
  job.state = delay_s > 0.0 ? JobState::waiting : JobState::queued;
  job.reason = reason;
  job.ready_boot_s = clock.get_boot_s() + delay_s;
  job.ready_boot_id = clock.get_boot_id();
}

bool change_running(registry::JobTable& table, const Job& job, const std::function<void(Job&)>& change, std::vector<Job>* changed) {
  return table.update(job.id, [&](Job& row) {
    if (row.state != JobState::running || row.token != job.token) return false;
    change(row);
    if (changed != nullptr) changed->push_back(row);
    return true;
  });
}

bool ask_to_stop(const Environment& at, const Job& job) {
  const std::optional<outcome::Attempt> attempt = at.disk.read_attempt(job.id);
  if (!attempt || !at.launcher.is_attempt_of(job, attempt->process)) return false;
  return at.launcher.send_signal(attempt->process.pid, SIGUSR1);
}

AttemptState find_attempt_state(const Environment& at, const Job& job) {
  if (at.disk.is_locked(job.id)) return AttemptState::working;
  const std::optional<outcome::Attempt> attempt = at.disk.read_attempt(job.id);
  if (attempt && attempt->token == job.token) return AttemptState::ended;
  switch (at.launcher.find_life(job.worker)) {
    case process::Life::running:
      return AttemptState::starting;
    case process::Life::elsewhere:
      return AttemptState::elsewhere;
    default:
      return AttemptState::not_begun;
  }
}

void apply(Job& job, const outcome::Outcome& outcome, const Clock& clock) {
  if (outcome.cause == outcome::Cause::done) return end(job, JobState::done, "");
  const outcome::RetryDecision decision = outcome::decide(outcome.cause, job.failures, outcome.is_further);
  job.failures = decision.failures;
  if (job.cancel_wanted) return end(job, JobState::cancelled, "cancelled while running; its checkpoint is kept for a retry");
  if (decision.next == outcome::Next::failed) {
    const bool has_tried = decision.failures > outcome::kMaxRetries;
    return end(job, JobState::failed,
               has_tried ? fmt::format("{}; given up after {} attempts in a row", outcome.reason, decision.failures) : outcome.reason);
  }
  wait(job, decision.delay_s, outcome.reason, clock);
}

std::vector<Job> settle(const Environment& at, registry::JobTable& table) {
  std::vector<Job> changed;
  for (const Job& job : table.list({JobState::running})) {
    if (job.engine != store::JobEngine::local) continue;
    const AttemptState state = find_attempt_state(at, job);
    if (state != AttemptState::ended && state != AttemptState::not_begun) continue;
    const auto change = [&](const std::function<void(Job&)>& act) { change_running(table, job, act, &changed); };
    if (at.disk.has_bank(job.id)) {
      change([](Job& row) { end(row, JobState::done, ""); });
      try {
        at.disk.remove_work(job.id);
      } catch (const SystemError&) {  // left to carillon gc
      }
    } else if (state == AttemptState::ended) {
      const outcome::Outcome outcome = find_outcome(at.disk, job);
      change([&](Job& row) { apply(row, outcome, at.clock); });
    } else {
      change([&](Job& row) {
        if (row.cancel_wanted) return end(row, JobState::cancelled, "cancelled");
        wait(row, 0.0, "", at.clock);
      });
    }
  }
  return changed;
}

void settle_not_begun(const Environment& at, registry::JobTable& table, const Job& job, int exit_code) {
  outcome::Outcome outcome = find_outcome(at.disk, job);
  if (outcome.cause == outcome::Cause::killed && exit_code < 128)
    outcome.reason = fmt::format("the attempt could not begin (exit code {}); see its log", exit_code);
  change_running(table, job, [&](Job& row) { apply(row, outcome, at.clock); });
}

void settle_not_started(const Environment& at, registry::JobTable& table, const Job& job, const SystemError& refusal) {
  outcome::Outcome outcome = outcome::make_killed(job.token);
  outcome.cause = at.disk.is_full(&refusal) ? outcome::Cause::disk_full : outcome::Cause::system;
  outcome.reason = refusal.what();
  change_running(table, job, [&](Job& row) { apply(row, outcome, at.clock); });
}

void cancel_not_started(Job& job) {
  const std::string what = job.state == JobState::failed ? "cancelled after it had failed"
                           : !job.reason.empty()         ? "cancelled while it waited"
                           : job.attempts > 0            ? "cancelled before it resumed"
                                                         : "cancelled before it ran";
  end(job, JobState::cancelled, job.reason.empty() ? what : what + ": " + job.reason);
}

CommandResult request_cancel(registry::JobTable& table, const store::Id& id) {
  CommandResult result{false, "there is no such job"};
  table.update(id, [&](Job& row) {
    switch (row.state) {
      case JobState::done:
        result = {false, "it is done already; its bank stays"};
        return false;
      case JobState::cancelled:
        result = {true, "it is cancelled already"};
        return false;
      case JobState::running:
        row.cancel_wanted = true;
        result = {true, "it is running, and was asked to stop"};
        return true;
      default:
        cancel_not_started(row);
        result = {true, "cancelled"};
        return true;
    }
  });
  return result;
}

CommandResult cancel(const Environment& at, registry::JobTable& table, const store::Id& id, double patience_s) {
  constexpr double kStepS = 0.1;
  const CommandResult result = request_cancel(table, id);
  const auto find_running = [&] {
    std::optional<Job> row = table.find(id);
    return row && row->state == JobState::running && row->engine == store::JobEngine::local ? row : std::nullopt;
  };
  if (!find_running()) return result;
  for (const double start_s = at.clock.get_boot_s(); at.clock.get_boot_s() - start_s < patience_s; at.clock.wait(kStepS)) {
    settle(at, table);
    const std::optional<Job> row = find_running();
    if (!row) break;
    ask_to_stop(at, *row);
  }
  const std::optional<Job> row = table.find(id);
  if (row && row->state == JobState::cancelled) return {true, "stopped and cancelled"};
  if (row && row->state == JobState::done) return {false, "it was done before it could be stopped; its bank stays"};
  return result;
}

CommandResult requeue(registry::JobTable& table, const store::Id& id, bool has_work, const std::function<void(Job&)>& change) {
  CommandResult result{false, "there is no such job"};
  table.update(id, [&](Job& row) {
    if (row.state == JobState::running || row.state == JobState::queued) {
      result = {false, row.state == JobState::running ? "it is running already" : "it is queued already"};
      return false;
    }
    if (!has_work) {
      result = {false, "its folder of work is no longer in the store; submit it again"};
      return false;
    }
    row.state = JobState::queued;
    row.reason.clear();
    row.failures = 0;
    row.cancel_wanted = false;
    row.ready_boot_s = 0.0;
    if (change) change(row);
    result = {true, "queued again"};
    return true;
  });
  return result;
}

CommandResult retry(const store::Store& store, registry::Registry& registry, const store::Id& id, const std::function<void(Job&)>& change) {
  const std::optional<Job> known = registry.find(id);
  if (!known) return {false, "there is no such job"};
  if (known->state == JobState::done && !store.find_bank_fault(id, store::Look::content))
    return {false, "it is done; there is nothing to do again"};
  // A running job is not changed.
  if (known->state == JobState::done || known->state == JobState::failed || known->state == JobState::cancelled) {
    if (const std::optional<std::string> refusal = restore(store, registry, id)) return {false, *refusal};
  }
  return requeue(registry, id, store.has_work(id), change);
}

}  // namespace carillon::queue
