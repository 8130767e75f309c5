// `carillon run`: works through the queue of this machine.
#pragma once

#include "jobs/queue/local.hpp"
#include "jobs/queue/runner.hpp"
#include "jobs/store/store.hpp"

namespace carillon::queue {

struct RunOptions {
  AttemptCommand attempt;
  RunnerOptions runner;
  bool json = false;   // JSON lines, also on a terminal
  bool quiet = false;  // no output
};

/// Starts jobs that fit, settles ended ones and adopts running ones, until no local job is open. Any number of processes may run on one
/// store. The first SIGINT or SIGTERM asks the attempts of this process to save and stop, and requeues them; the second ends them. Takes
/// over the signals of the process. Returns 0 if all jobs are done, 3 if one failed or was cancelled, 130 or 143 after SIGINT or SIGTERM.
/// SystemError for an unusable store.
int run(const store::Store& store, const RunOptions& options);

}  // namespace carillon::queue
