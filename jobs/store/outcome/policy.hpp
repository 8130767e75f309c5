// Why an attempt ended, in one true sentence, and what follows from it. Pure functions: no clock, no disk.
#pragma once

#include <optional>
#include <string>

#include "jobs/store/outcome/outcome.hpp"
#include "runtime/base/result.hpp"

namespace carillon::outcome {

/// How the program ended, as far as it is known.
struct Ending {
  int exit_code = 0;               // 128 + signal when a signal ended it
  bool was_asked_to_stop = false;  // by a signal to this attempt
  bool was_out_of_time = false;
  bool was_hung = false;
  double hang_s = 0.0;                      // was_hung: how long nothing had moved
  bool was_kernel_out_of_memory = false;    // the kernel killed a process for memory meanwhile
  bool is_disk_full = false;                // hardly a byte is free where it writes
  std::optional<base::Result> result = {};  // what it left itself; none: a signal ended it, or it could not begin
  std::string dead_rank = {};               // whom mpirun names: "rank 1 on node3"; for people, it decides nothing
  bool has_saved = false;                   // its checkpoint is newer than before
  double memory_limit_gb = 0.0;             // the job's "memory_gb"; 0: none
  double held_gb = 0.0;                     // memory at the kill for exceeding the limit; 0: no such kill
};

struct FailureCause {
  Cause cause = Cause::killed;
  std::string reason;           // one sentence without a full stop at its end; empty when done
  double memory_need_gb = 0.0;  // cause memory: what the solver needs by its own result; 0: not known
};
FailureCause classify(const Ending& ending);

inline constexpr int kMaxRetries = 3;

enum class Next { done, failed, queue, wait };
struct RetryDecision {
  Next next = Next::failed;
  double delay_s = 0.0;  // wait: at least this long, in boot time
  int failures = 0;      // the new count
};

/// After `failures` attempts that count (0 at first). `is_further`: this one saved more in its checkpoint than any before, and the count
/// starts again. docs/howto/when-jobs-die.md has the table.
RetryDecision decide(Cause cause, int failures, bool is_further);

/// What to ask for from now on after an attempt that ended for lack of memory [GB]: a little more than it said that it needs, and more than
/// it was seen to use.
double calc_next_memory(double need_gb, double peak_gb);

}  // namespace carillon::outcome
