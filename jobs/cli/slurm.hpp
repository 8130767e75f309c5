// The commands' side of jobs in Slurm.
#pragma once

#include <filesystem>

#include "jobs/cli/shared.hpp"
#include "jobs/queue/run.hpp"
#include "jobs/queue/settle.hpp"

namespace carillon::cli {

/// Brings the rows of jobs in Slurm up to date. Asks Slurm only when there are any, and not more often than the profile says.
void follow_slurm(Shared& shared);

/// Hands over what is ready for Slurm. Returns how many jobs Slurm took.
std::size_t hand_over_to_slurm(Shared& shared);

/// As queue::cancel, for a job of the engine "slurm".
queue::CommandResult cancel_in_slurm(Shared& shared, const store::Id& id);

/// carillon run --on slurm: hands over, follows, and hands over again what can be tried again, until no job of Slurm's is open (`keep`: for
/// ever). Options used: keep, quiet, has_pictures; the others concern this machine. The exit code: 0, or 3 when a job
/// failed or was cancelled.
int run_with_slurm(Shared& shared, const queue::RunOptions& options);

}  // namespace carillon::cli
