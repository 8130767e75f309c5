// What an attempt does about Slurm when it runs inside one of its jobs.
#pragma once

#include <filesystem>

#include "jobs/store/outcome/outcome.hpp"

namespace carillon::slurm {

/// What the outcome of an attempt means here: it is Slurm that asks to save and stop, before the time limit.
outcome::Outcome explain_stop(outcome::Outcome outcome);

/// After run_attempt() ended with `exit_code`: a job that continues is queued again in Slurm, with the back-off of its cause, unless Slurm
/// is ending it itself (cancelled, time over, node taken away). Returns the exit code for Slurm: the same, or 4 when the job has failed too
/// often. When Slurm does not queue it again the row's keeper hands it over again. Outside Slurm nothing is done.
int end_attempt(const std::filesystem::path& work, int exit_code);

}  // namespace carillon::slurm
