// Rows and the processes behind them: what became of attempts, cancel, retry. Used by everything that opens the registry, so that no row
// stays "running" when no attempt runs.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "jobs/outcome/outcome.hpp"
#include "jobs/process/process.hpp"
#include "jobs/registry/registry.hpp"
#include "jobs/store/store.hpp"

namespace carillon::queue {

/// Where a running row of the engine "local" stands.
enum class Standing {
  working,   // a process works in its folder
  starting,  // claimed, and who claimed it or was started for it is there
  ended,     // its attempt has ended
  unbegun,   // claimed, and whoever claimed it is gone before anything began
  elsewhere  // claimed on another machine
};
Standing find_standing(const store::Store& store, const registry::Job& job);

/// Whether a process that lives is the attempt of this row: it was started with the row's token. attempt.json, which every member of a
/// group may write, can name another process, and that must get no signal.
bool is_attempt_of(const registry::Job& job, const process::Identity& found);

/// Changes a row by what came of its attempt: done, failed, cancelled (when that was wanted), waiting or queued. Pure.
void apply(registry::Job& job, const outcome::Outcome& outcome);

/// Settles every running local row whose process is gone: by its bank, by the outcome it left, else as killed. Returns the rows that
/// changed, as they are now.
std::vector<registry::Job> settle(const store::Store& store, registry::Registry& registry);

/// Settles one row whose attempt was seen to end with this exit code before it said that it had begun.
void settle_unbegun(const store::Store& store, registry::Registry& registry, const registry::Job& job, int exit_code);

/// Settles one row that was claimed here and could not be started.
void settle_unstarted(const store::Store& store, registry::Registry& registry, const registry::Job& job, const std::string& refusal);

/// What cancel and retry did, in one sentence for people, and whether it is what was asked for.
struct Said {
  bool is_done = false;
  std::string text;
};

/// A queued or waiting job is cancelled at once. A running one is asked to save and stop, and this waits until it has, `patience_s` at
/// most; later whoever runs the queue sees to it. A job that is done stays done. Jobs of the engine "slurm" only get the wish:
/// carillon::slurm looks after them.
Said cancel(const store::Store& store, registry::Registry& registry, const store::Id& id, double patience_s = 90.0);

/// Cancels a row without a running attempt; its reason says what it was, and why it had failed or waited. Pure.
void cancel_unstarted(registry::Job& job);

/// Puts a failed or cancelled job back into the queue, with its checkpoint and a new count of retries; a waiting one is ready at once.
/// `change` edits the row in the same transaction (what it asks for from now on), where it is put back.
Said retry(const store::Store& store, registry::Registry& registry, const store::Id& id,
           const std::function<void(registry::Job&)>& change = {});

}  // namespace carillon::queue
