// Method:     Permanent causes fail the job at once. Transient causes are retried after 10, 40 and 160 s; an attempt with progress resets
//             the count. A full disk is waited for without limit. Table: docs/howto/jobs.md.
#include "jobs/store/outcome/policy.hpp"

#include <algorithm>
#include <cmath>

namespace carillon::outcome {
namespace {

constexpr double kFirstDelayS = 10.0, kDelayGrowth = 4.0, kDiskDelayS = 10.0;
constexpr double kNeedMargin = 1.1, kPeakGrowth = 1.5;

}  // namespace

RetryDecision decide(Cause cause, int failures, bool is_further) {
  if (is_further) failures = 0;
  switch (cause) {
    case Cause::done:
      return {Next::done, 0.0, 0};
    case Cause::bad_input:
    case Cause::no_solution:
    case Cause::no_program:
    case Cause::memory_limit:
      return {Next::failed, 0.0, failures};
    case Cause::stopped:
    case Cause::checkpointed:
    case Cause::predicted:
      return {Next::queue, 0.0, failures};
    case Cause::disk_full:
      return {Next::wait, kDiskDelayS, failures};
    case Cause::time_limit:
      if (is_further) return {Next::queue, 0.0, 0};
      [[fallthrough]];
    default:
      if (failures >= kMaxRetries) return {Next::failed, 0.0, failures + 1};
      return {Next::wait, kFirstDelayS * std::pow(kDelayGrowth, failures), failures + 1};
  }
}

double calc_next_memory(double need_gb, double peak_gb) { return std::max(kNeedMargin * need_gb, kPeakGrowth * peak_gb); }

}  // namespace carillon::outcome
