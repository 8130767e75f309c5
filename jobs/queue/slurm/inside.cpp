// Method:     `scontrol requeue` from inside the job is the last action: Slurm then kills this process too.
// Source:     scontrol(1) of Slurm 22.05.
#include "jobs/queue/slurm/inside.hpp"

#include <fmt/core.h>

#include <cstdlib>
#include <optional>

#include "jobs/queue/slurm/client.hpp"
#include "jobs/queue/slurm/records.hpp"
#include "jobs/store/files.hpp"
#include "jobs/store/outcome/policy.hpp"
#include "jobs/store/store.hpp"

namespace carillon::slurm {
namespace {

/// Causes for which a repetition with the same resources is useless: the submitting host decides.
bool is_for_outside(outcome::Cause cause) { return cause == outcome::Cause::memory; }

}  // namespace

outcome::Outcome explain_stop(outcome::Outcome outcome) {
  if (outcome.cause != outcome::Cause::stopped && outcome.cause != outcome::Cause::checkpointed) return outcome;
  outcome.cause = outcome::Cause::time_limit;
  outcome.reason = outcome.is_further ? fmt::format("saved at {:.0f} % before the time limit of the Slurm job", outcome.percent)
                                      : "the time limit of the Slurm job was reached without progress to save; request more time";
  return outcome;
}

int end_attempt(const std::filesystem::path& work, int exit_code) {
  const char* job = std::getenv("SLURM_JOB_ID");
  if (job == nullptr || exit_code != kExitCheckpointed) return exit_code;
  const std::optional<outcome::Outcome> left = outcome::read_outcome(work);
  if (!left || is_for_outside(left->cause)) return exit_code;
  const SlurmClient client{queue::SlurmSettings{}};
  const int failures = read_failures(work);
  try {
    if (!client.is_running(job)) return exit_code;
    const outcome::Outcome outcome = explain_stop(*left);
    outcome::write_outcome(work, outcome);
    const outcome::RetryDecision decision = outcome::decide(outcome.cause, failures, outcome.is_further);
    if (decision.next == outcome::Next::failed) return kExitSystem;
    write_failures(work, decision.failures);
    store::append_text(work / store::kLogFile, "carillon: " + outcome.reason + "; queued again in Slurm\n");
    client.requeue(job, decision.delay_s);
  } catch (const SystemError& error) {
    fmt::print(stderr, "carillon: {}\n", error.what());
    try {
      write_failures(work, failures);
    } catch (const SystemError&) {
    }
  }
  return exit_code;
}

}  // namespace carillon::slurm
