// Method:     Causes that cannot pass end a job at once. Causes that can pass are tried again after 10, 40 and 160 s; an attempt that
//             saved more than all before it starts the count anew. A full disk is waited for, however long.
// Source:     own choice; docs/howto/jobs.md has the table.
// Deviations: none.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>

#include "jobs/outcome/outcome.hpp"

namespace carillon::outcome {
namespace {

constexpr double kFirstDelayS = 10.0, kDelayGrowth = 4.0;
constexpr double kDiskDelayS = 10.0;
constexpr double kMemoryGrowth = 1.5;  // of the peak seen, when nobody knows the need

Decision calc_retry(const Outcome& outcome, int failures) {
  if (failures >= kMostRetries) {
    return {Next::failed, 0.0, failures + 1, 0.0, fmt::format("{}; given up after {} attempts", outcome.reason, failures + 1)};
  }
  return {Next::wait, kFirstDelayS * std::pow(kDelayGrowth, failures), failures + 1, 0.0, outcome.reason};
}

Decision calc_memory(const Outcome& outcome, int failures) {
  Decision decision = calc_retry(outcome, failures);
  // The queue starts it again only where so much is free, and fails it when no moment of this machine has that.
  decision.memory_gb = std::max(1.1 * outcome.memory_need_gb, kMemoryGrowth * outcome.peak_memory_gb);
  return decision;
}

}  // namespace

Decision decide(const Outcome& outcome, int failures) {
  if (outcome.is_further) failures = 0;
  switch (outcome.cause) {
    case Cause::none:
      return {Next::done, 0.0, 0, 0.0, ""};
    case Cause::input:
    case Cause::solve:
    case Cause::start:
      return {Next::failed, 0.0, failures, 0.0, outcome.reason};
    case Cause::stopped:
    case Cause::checkpointed:
      return {Next::queue, 0.0, failures, 0.0, outcome.reason};
    case Cause::time_limit:
      if (outcome.is_further) return {Next::queue, 0.0, 0, 0.0, outcome.reason};
      return calc_retry(outcome, failures);
    case Cause::disk_full:
      return {Next::wait, kDiskDelayS, failures, 0.0, outcome.reason};
    case Cause::memory:
      return calc_memory(outcome, failures);
    default:
      return calc_retry(outcome, failures);
  }
}

}  // namespace carillon::outcome
