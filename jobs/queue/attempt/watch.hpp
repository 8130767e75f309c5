// Supervision of a running solver: signals, time limit, hang detection, memory.
#pragma once

#include <sys/types.h>

#include <string>

#include "jobs/queue/attempt/attempt.hpp"

namespace carillon::attempt {

/// Observations until its end.
struct Watched {
  int exit_code = 0;  // 128 + signal if ended by a signal
  bool was_asked_to_stop = false;
  bool was_out_of_time = false;
  bool was_over_memory = false;  // killed above options.memory_limit_gb
  bool was_hung = false;
  double still_s = 0.0;         // was_hung: duration without output and CPU time
  double peak_memory_gb = 0.0;  // resident, `child` and all descendants
};

/// Blocks the signals that watch() waits for, and makes this process a subreaper. Call before start().
void take_signals();

/// Waits for `child` (of start()), then kills remaining processes of the attempt.
Watched watch(pid_t child, const Options& options, const std::string& token);

}  // namespace carillon::attempt
