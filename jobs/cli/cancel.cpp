// carillon cancel and carillon retry.
#include <fmt/core.h>

#include <cstdio>
#include <optional>

#include "jobs/cli/commands.hpp"
#include "jobs/cli/slurm.hpp"
#include "jobs/queue/local.hpp"
#include "jobs/queue/settle.hpp"
#include "runtime/base/error.hpp"

namespace carillon::cli {
namespace {

/// Calls `act` for each job and prints the results. Exit code 1 if one was not successful.
template <class Act>
int do_to_all(Shared& shared, const std::vector<registry::Job>& jobs, const Act& act) {
  bool is_done = true;
  base::Json root;
  root["jobs"] = base::Json::array();
  for (const registry::Job& job : jobs) {
    const queue::CommandResult result = act(job);
    is_done = is_done && result.is_done;
    if (shared.json) {
      base::Json entry = describe(shared, shared.registry().find(job.id).value_or(job));
      entry.set("did", result.is_done).set("said", to_json(result.text));
      root["jobs"].append(entry);
    } else {
      fmt::print("{}  {}: {}\n", job.id.short_text(), show(job.name), show_message(result.text));
      std::fflush(stdout);
    }
  }
  if (shared.json) print_json(root);
  return is_done ? 0 : kExitNotYet;
}

}  // namespace

int run_cancel(Shared& shared, const CancelOptions& options) {
  shared.settle();
  return do_to_all(shared, find_jobs(shared, options.words), [&](const registry::Job& job) {
    return job.engine == store::JobEngine::slurm ? cancel_in_slurm(shared, job.id)
                                                 : queue::cancel(queue::LocalEnvironment(shared.store()), shared.registry(), job.id);
  });
}

int run_retry(Shared& shared, const RetryOptions& options) {
  if (options.resources.engine == "slurm") check_slurm();
  shared.settle();
  if (options.words.empty() && !options.all_failed)
    throw InputError("no job given; give an id or a job file, or --failed for all failed jobs");
  std::vector<registry::Job> jobs = find_jobs(shared, options.words);
  if (options.all_failed) {
    for (registry::Job& job : shared.registry().list({registry::JobState::failed})) jobs.push_back(std::move(job));
  }
  std::optional<store::Lock> lock = shared.store().lock_shared();  // gc waits
  bool is_for_slurm = false;
  const int code = do_to_all(shared, jobs, [&](const registry::Job& job) -> queue::CommandResult {
    try {
      return queue::retry(shared.store(), shared.registry(), job.id, [&](registry::Job& row) {
        options.resources.apply(row);
        if (row.engine != store::JobEngine::slurm) return;
        check_slurm();
        is_for_slurm = true;
      });
    } catch (const InputError& error) {
      return {false, error.what()};
    }
  });
  lock.reset();
  if (is_for_slurm) hand_over_to_slurm(shared);
  return code;
}

}  // namespace carillon::cli
