// Rows and the processes behind them: what became of attempts, cancel, retry. Used by everything that opens the registry, so that no row
// stays "running" when no attempt runs.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "jobs/store/outcome/outcome.hpp"
#include "jobs/queue/environment.hpp"
#include "jobs/store/registry/registry.hpp"
#include "jobs/store/store.hpp"

namespace carillon::queue {

/// The attempt of a running row of the engine "local".
enum class AttemptState {
  working,   // a process works in its folder
  starting,  // claimed, and the process that claimed it or was started for it lives
  ended,
  not_begun,  // claimed, and that process is gone before anything began
  elsewhere   // claimed on another machine
};
AttemptState find_attempt_state(const Environment& at, const registry::Job& job);

/// Asks the attempt of a running row to save and stop. False: there is none that can be reached.
bool ask_to_stop(const Environment& at, const registry::Job& job);

/// Changes a row by what came of its attempt: done, failed, cancelled (when that was wanted), waiting or queued.
void apply(registry::Job& job, const outcome::Outcome& outcome, const Clock& clock);

/// Settles every running local row whose process is gone: by its bank, by the outcome it left, else as killed. Returns the rows that
/// changed, as they are now.
std::vector<registry::Job> settle(const Environment& at, registry::JobTable& table);

/// Settles one row whose attempt was seen to end with this exit code before attempt.json was written.
void settle_not_begun(const Environment& at, registry::JobTable& table, const registry::Job& job, int exit_code);

/// Settles one row that was claimed here and could not be started.
void settle_not_started(const Environment& at, registry::JobTable& table, const registry::Job& job, const SystemError& refusal);

/// What a command did to one job, in one sentence for people, and whether it is what was asked for.
struct CommandResult {
  bool is_done = false;
  std::string text;
};

/// Cancels a job that does not run; a running one only gets the request.
CommandResult request_cancel(registry::JobTable& table, const store::Id& id);

/// A queued or waiting job is cancelled at once. A running one is asked to save and stop, and this waits until it has, `patience_s` at
/// most; later the process that runs the queue does it. A job that is done stays done. Jobs of the engine "slurm" only get the request:
/// carillon::slurm looks after them.
CommandResult cancel(const Environment& at, registry::JobTable& table, const store::Id& id, double patience_s = 90.0);

/// Cancels a row without a running attempt; its reason says what it was, and why it had failed or waited. Pure.
void cancel_not_started(registry::Job& job);

/// Puts a row that has ended or waits back into the queue, with a new count of retries. `has_work`: its folder of work is there. `change`
/// edits the row in the same transaction (what it asks for from now on), where it is put back.
CommandResult requeue(registry::JobTable& table, const store::Id& id, bool has_work,
                      const std::function<void(registry::Job&)>& change = {});

/// The same, after what is damaged of a failed or cancelled job was made again. Its checkpoint stays.
CommandResult retry(const store::Store& store, registry::Registry& registry, const store::Id& id,
                    const std::function<void(registry::Job&)>& change = {});

}  // namespace carillon::queue
