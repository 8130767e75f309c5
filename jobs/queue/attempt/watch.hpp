// Looks after a running solver until it has ended: signals, time limit, a watchdog, the memory it takes.
#pragma once

#include <sys/types.h>

#include <string>

#include "jobs/queue/attempt/attempt.hpp"

namespace carillon::attempt {

/// What became of it.
struct Watched {
  int exit_code = 0;  // 128 + signal when a signal ended it
  bool was_asked_to_stop = false;
  bool was_out_of_time = false;
  bool was_over_memory = false;  // killed above options.memory_limit_gb
  bool was_hung = false;
  double still_s = 0.0;         // was_hung: how long nothing had moved
  double peak_memory_gb = 0.0;  // resident, all processes below `child` together
};

/// Blocks the signals that take_signals() and watch() wait for, and makes this process adopt orphans. Call before start().
void take_signals();

/// Waits for `child` (of start()), and kills what is left of the attempt then.
Watched watch(pid_t child, const Options& options, const std::string& token);

}  // namespace carillon::attempt
