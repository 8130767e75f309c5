// Classification of the end of an attempt, and the retry policy. Pure functions.
#pragma once

#include <optional>
#include <string>

#include "jobs/store/outcome/outcome.hpp"
#include "runtime/base/result.hpp"

namespace carillon::outcome {

/// Observations at the end of a program.
struct Ending {
  int exit_code = 0;               // 128 + signal when a signal ended it
  bool was_asked_to_stop = false;  // by a signal to the attempt
  bool was_out_of_time = false;
  bool was_hung = false;
  double hang_s = 0.0;                      // was_hung: duration without output and CPU time
  bool was_kernel_out_of_memory = false;    // the kernel killed processes for lack of memory meanwhile
  bool is_disk_full = false;                // less than 1 MB free in the folder of work
  std::optional<base::Result> result = {};  // result.json; none: ended by a signal, or not started
  std::string dead_rank = {};               // "rank 1 on node3" as mpirun reports it; for display only
  bool has_saved = false;                   // wrote a new checkpoint
  double memory_limit_gb = 0.0;             // "memory_gb" of the job; 0: none
  double held_gb = 0.0;                     // memory at the kill for exceeding the limit; 0: no such kill
};

struct FailureCause {
  Cause cause = Cause::killed;
  std::string reason;           // one sentence without a full stop; empty if done
  double memory_need_gb = 0.0;  // cause memory: need reported by the solver; 0: unknown
};
FailureCause classify(const Ending& ending);

inline constexpr int kMaxRetries = 3;

enum class Next { done, failed, queue, wait };
struct RetryDecision {
  Next next = Next::failed;
  double delay_s = 0.0;  // wait: minimum, in boot time
  int failures = 0;      // the new count
};

/// `failures`: consecutive failed attempts before this one. `is_further`: this attempt made progress, which resets the count. Table:
/// docs/howto/jobs.md.
RetryDecision decide(Cause cause, int failures, bool is_further);

/// Memory to request after an attempt that ran out of memory [GB]: 1.1 times the reported need, at least 1.5 times the observed peak.
double calc_next_memory(double need_gb, double peak_gb);

}  // namespace carillon::outcome
