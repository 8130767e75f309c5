// The loop of `carillon run`: works through the queue of this machine.
#pragma once

#include "jobs/queue/local.hpp"
#include "jobs/queue/runner.hpp"
#include "jobs/store/store.hpp"

namespace carillon::queue {

struct RunOptions {
  AttemptCommand attempt;
  RunnerOptions runner;
  bool json = false;   // JSON lines, on a terminal too
  bool quiet = false;  // neither bar nor lines
};

/// Starts what fits, settles what ends, adopts what others left running, until no local job is queued, waiting or running. Any number may
/// run at once on one store. The first SIGINT or SIGTERM asks all attempts that this process started to save and stop, and puts them back
/// into the queue; the second ends them. Takes over the signals of the process. Returns 0 when all jobs are done, 3 when one failed or was
/// cancelled, 130 or 143 after SIGINT or SIGTERM. SystemError for an unusable store.
int run(const store::Store& store, const RunOptions& options);

}  // namespace carillon::queue
