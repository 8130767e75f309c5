// State changes of rows: end of attempts, cancel, retry. Every command that opens the registry settles first, so that no row stays
// "running" without a running attempt.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "jobs/queue/environment.hpp"
#include "jobs/store/outcome/outcome.hpp"
#include "jobs/store/registry/registry.hpp"
#include "jobs/store/store.hpp"

namespace carillon::queue {

/// The attempt of a running row of the engine "local".
enum class AttemptState {
  working,   // the lock of its folder is held
  starting,  // claimed, and the claiming or started process is alive
  ended,
  not_begun,  // claimed, and that process is gone
  elsewhere   // claimed on another machine
};
AttemptState find_attempt_state(const Environment& at, const registry::Job& job);

/// Asks the attempt of a running row to save and stop. False: not reachable.
bool ask_to_stop(const Environment& at, const registry::Job& job);

/// Changes the row of a running job unless its attempt is another one by now, and appends it to `changed`. True if changed.
bool change_running(registry::JobTable& table, const registry::Job& job, const std::function<void(registry::Job&)>& change,
                    std::vector<registry::Job>* changed = nullptr);

/// Ends a row in this state.
void end(registry::Job& job, registry::JobState state, const std::string& reason);

/// Queued, or waiting for `delay_s` of boot time.
void wait(registry::Job& job, double delay_s, const std::string& reason, const Clock& clock);

/// Changes a row by the outcome of its attempt: done, failed, cancelled (if requested), waiting or queued.
void apply(registry::Job& job, const outcome::Outcome& outcome, const Clock& clock);

/// Settles every running local row whose process is gone: from its bank, its outcome, else as killed. Returns the changed rows.
std::vector<registry::Job> settle(const Environment& at, registry::JobTable& table);

/// Settles a row whose attempt ended with this exit code before it wrote attempt.json.
void settle_not_begun(const Environment& at, registry::JobTable& table, const registry::Job& job, int exit_code);

/// Settles a row that was claimed here and could not be started.
void settle_not_started(const Environment& at, registry::JobTable& table, const registry::Job& job, const SystemError& refusal);

/// Result of a command for one job: success, and one sentence for display.
struct CommandResult {
  bool is_done = false;
  std::string text;
};

/// Cancels a job that does not run; for a running one sets cancel_wanted.
CommandResult request_cancel(registry::JobTable& table, const store::Id& id);

/// Cancels a queued or waiting job at once. A running one is asked to save and stop; waits up to `patience_s` for it (later the queue
/// settles it). A done job stays done. For jobs of the engine "slurm" sets only cancel_wanted.
CommandResult cancel(const Environment& at, registry::JobTable& table, const store::Id& id, double patience_s = 90.0);

/// Cancels a row without a running attempt, with its previous state and reason as the reason. Pure.
void cancel_not_started(registry::Job& job);

/// Requeues an ended or waiting row, with a new retry count. `has_work`: its folder of work exists. `change` edits the row in the same
/// transaction.
CommandResult requeue(registry::JobTable& table, const store::Id& id, bool has_work,
                      const std::function<void(registry::Job&)>& change = {});

/// The same, after repair() of a failed or cancelled job. Its checkpoint stays.
CommandResult retry(const store::Store& store, registry::Registry& registry, const store::Id& id,
                    const std::function<void(registry::Job&)>& change = {});

}  // namespace carillon::queue
