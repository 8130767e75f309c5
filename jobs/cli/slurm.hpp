// Commands for jobs in Slurm.
#pragma once

#include "jobs/cli/shared.hpp"
#include "jobs/queue/run.hpp"
#include "jobs/queue/settle.hpp"

namespace carillon::cli {

/// Refuses jobs on Slurm in a build without the component SLURM. Throws InputError.
void check_slurm();

/// Updates the rows of jobs in Slurm, at most once per poll interval of the profile.
void follow_slurm(Shared& shared);

/// Submits ready jobs to Slurm. Returns the number of accepted jobs.
std::size_t hand_over_to_slurm(Shared& shared);

/// queue::cancel() for a job of the engine "slurm".
queue::CommandResult cancel_in_slurm(Shared& shared, const store::Id& id);

/// carillon run --on slurm: submits and follows jobs until none is open (`keep`: forever). Uses only the options keep, quiet and
/// has_pictures. Exit code: 0, or 3 if a job failed or was cancelled.
int run_with_slurm(Shared& shared, const queue::RunOptions& options);

}  // namespace carillon::cli
