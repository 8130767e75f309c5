// Method:     Whether somebody works is told by the lock on the folder of the work, which the kernel takes back from whoever dies;
// attempt.json
//             tells whether the claimed attempt began. Clocks are not asked. Changes are made in write transactions that look again first.
// Source:     docs/howto/when-jobs-die.md. Deviations: none.
#include "jobs/queue/settle.hpp"

#include <fmt/core.h>
#include <signal.h>
#include <time.h>

#include <algorithm>
#include <fstream>
#include <optional>

#include "jobs/outcome/policy.hpp"
#include "jobs/process/process.hpp"
#include "jobs/queue/repair.hpp"
#include "jobs/store/files.hpp"

namespace carillon::queue {
namespace {

using registry::Job;
using registry::State;

void end(Job& job, State state, const std::string& reason) {
  job.state = state;
  job.reason = reason;
  job.cancel_wanted = false;
  job.ended_unix_s = static_cast<double>(::time(nullptr));
}

void wait(Job& job, double delay_s, const std::string& reason) {
  job.state = delay_s > 0.0 ? State::waiting : State::queued;
  job.reason = reason;
  job.ready_boot_s = process::find_boot_seconds() + delay_s;
  job.ready_boot_id = process::find_boot();
}

/// The end of the attempt that worked in this folder last.
outcome::Outcome find_outcome(const std::filesystem::path& work, const std::string& token) {
  if (std::optional<outcome::Outcome> outcome = outcome::read_outcome(work); outcome && outcome->token == token) return *outcome;
  outcome::Outcome outcome = outcome::make_killed(token);
  if (store::is_disk_full(work)) {
    outcome.cause = outcome::Cause::disk_full;
    outcome.reason = "the disk of the store is full, and how the attempt ended could not be written";
  }
  return outcome;
}

/// Changes the row of `job` unless somebody else did meanwhile; true when this call did.
bool change_running(registry::Registry& registry, const Job& job, const std::function<void(Job&)>& change, std::vector<Job>* changed) {
  const bool is_changed = registry.update(job.id, [&](Job& row) {
    if (row.state != State::running || row.token != job.token) return false;
    change(row);
    if (changed != nullptr) changed->push_back(row);
    return true;
  });
  return is_changed;
}

/// Asks the process that works on the job to save and stop. False: there is none that can be reached.
bool ask_to_stop(const store::Store& store, const Job& job, int signal) {
  const std::optional<outcome::Attempt> attempt = outcome::read_attempt(store.work_folder(job.id));
  if (!attempt || !is_attempt_of(job, attempt->process)) return false;
  return ::kill(attempt->process.pid, signal) == 0;
}

void sleep_ms(long milliseconds) {
  const timespec time{milliseconds / 1000, (milliseconds % 1000) * 1000000};
  ::nanosleep(&time, nullptr);
}

}  // namespace

bool is_attempt_of(const Job& job, const process::Identity& found) {
  const bool is_token = job.token.size() == 32 && job.token.find_first_not_of("0123456789abcdef") == std::string::npos;
  if (!is_token || process::find_life(found) != process::Life::running) return false;
  std::ifstream words(fmt::format("/proc/{}/cmdline", found.pid), std::ios::binary);
  for (std::string word; std::getline(words, word, '\0');) {
    if (word == job.token) return true;
  }
  return false;
}

Standing find_standing(const store::Store& store, const Job& job) {
  const std::filesystem::path work = store.work_folder(job.id);
  if (process::Lock::is_held(work / "lock")) return Standing::working;
  const std::optional<outcome::Attempt> attempt = outcome::read_attempt(work);
  if (attempt && attempt->token == job.token) return Standing::ended;
  switch (process::find_life(job.worker)) {
    case process::Life::running:
      return Standing::starting;
    case process::Life::elsewhere:
      return Standing::elsewhere;
    default:
      return Standing::unbegun;
  }
}

void apply(Job& job, const outcome::Outcome& outcome) {
  if (outcome.cause == outcome::Cause::done) return end(job, State::done, "");
  const outcome::Decision decision = outcome::decide(outcome.cause, job.failures, outcome.is_further);
  job.failures = decision.failures;
  if (outcome.cause == outcome::Cause::memory)
    job.resources.memory_gb = std::max(job.given.memory_gb, outcome::calc_next_memory(outcome.memory_need_gb, outcome.peak_memory_gb));
  if (job.cancel_wanted) return end(job, State::cancelled, "cancelled while it ran; what it had saved is kept for a retry");
  if (decision.next == outcome::Next::failed) {
    const bool has_tried = decision.failures > outcome::kMostRetries;
    return end(job, State::failed,
               has_tried ? fmt::format("{}; given up after {} attempts in a row", outcome.reason, decision.failures) : outcome.reason);
  }
  wait(job, decision.delay_s, outcome.reason);
}

std::vector<Job> settle(const store::Store& store, registry::Registry& registry) {
  std::vector<Job> changed;
  for (const Job& job : registry.list({State::running})) {
    if (job.engine != "local") continue;
    const std::filesystem::path work = store.work_folder(job.id);
    const Standing standing = find_standing(store, job);
    if (standing == Standing::working || standing == Standing::starting || standing == Standing::elsewhere) continue;
    if (store.has_bank(job.id)) {
      change_running(
          registry, job, [](Job& row) { end(row, State::done, ""); }, &changed);
      store.remove_work(job.id);
    } else if (standing == Standing::ended) {
      const outcome::Outcome outcome = find_outcome(work, job.token);
      change_running(
          registry, job, [&](Job& row) { apply(row, outcome); }, &changed);
    } else {
      change_running(
          registry, job,
          [](Job& row) {
            if (row.cancel_wanted) return end(row, State::cancelled, "cancelled");
            wait(row, 0.0, "");
          },
          &changed);
    }
  }
  return changed;
}

void settle_unbegun(const store::Store& store, registry::Registry& registry, const Job& job, int exit_code) {
  outcome::Outcome outcome = find_outcome(store.work_folder(job.id), job.token);
  if (outcome.cause == outcome::Cause::killed && exit_code < 128)
    outcome.reason = fmt::format("the attempt could not begin (exit code {}); its log says why", exit_code);
  change_running(
      registry, job, [&](Job& row) { apply(row, outcome); }, nullptr);
}

void settle_unstarted(const store::Store& store, registry::Registry& registry, const Job& job, const std::string& refusal) {
  outcome::Outcome outcome = outcome::make_killed(job.token);
  outcome.cause = store::is_disk_full(store.root(), refusal) ? outcome::Cause::disk_full : outcome::Cause::system;
  outcome.reason = refusal;
  change_running(
      registry, job, [&](Job& row) { apply(row, outcome); }, nullptr);
}

void cancel_unstarted(Job& job) {
  const std::string what = job.state == State::failed ? "cancelled after it had failed"
                           : !job.reason.empty()      ? "cancelled while it waited"
                           : job.attempts > 0         ? "cancelled before it went on"
                                                      : "cancelled before it ran";
  end(job, State::cancelled, job.reason.empty() ? what : what + ": " + job.reason);
}

Said cancel(const store::Store& store, registry::Registry& registry, const store::Id& id, double patience_s) {
  Said answer{false, "there is no such job"};
  bool is_running = false;
  registry.update(id, [&](Job& row) {
    switch (row.state) {
      case State::done:
        answer = {false, "it is done already; its bank stays"};
        return false;
      case State::cancelled:
        answer = {true, "it is cancelled already"};
        return false;
      case State::running:
        is_running = row.engine == "local";
        row.cancel_wanted = true;
        answer = {true, "it runs, and is asked to stop"};
        return true;
      default:
        cancel_unstarted(row);
        answer = {true, "cancelled"};
        return true;
    }
  });
  if (!is_running) return answer;
  // Who looks at the boot clock here only stops waiting by it.
  for (const double start = process::find_boot_seconds(); process::find_boot_seconds() - start < patience_s; sleep_ms(100)) {
    settle(store, registry);
    const std::optional<Job> row = registry.find(id);
    if (!row || row->state != State::running) break;
    ask_to_stop(store, *row, SIGUSR1);
  }
  const std::optional<Job> row = registry.find(id);
  if (row && row->state == State::cancelled) return {true, "stopped and cancelled"};
  if (row && row->state == State::done) return {false, "it was done before it could be stopped; its bank stays"};
  return answer;
}

Said retry(const store::Store& store, registry::Registry& registry, const store::Id& id, const std::function<void(Job&)>& change) {
  Said answer{false, "there is no such job"};
  const std::optional<Job> known = registry.find(id);
  if (!known) return answer;
  if (known->state == State::done && !store.find_bank_fault(id, store::Look::full))
    return {false, "it is done; there is nothing to do again"};
  // A job that somebody works on is not touched.
  if (known->state == State::done || known->state == State::failed || known->state == State::cancelled) {
    if (const std::optional<std::string> refusal = restore(store, registry, id)) return {false, *refusal};
  }
  registry.update(id, [&](Job& row) {
    if (row.state == State::running || row.state == State::queued) {
      answer = {false, row.state == State::running ? "it runs already" : "it is queued already"};
      return false;
    }
    if (!store.has_work(id)) {
      answer = {false, "what it was to work on is gone from the store; submit it again"};
      return false;
    }
    row.state = State::queued;
    row.reason.clear();
    row.failures = 0;
    row.cancel_wanted = false;
    row.ready_boot_s = 0.0;
    if (change) change(row);
    answer = {true, "queued again"};
    return true;
  });
  return answer;
}

}  // namespace carillon::queue
