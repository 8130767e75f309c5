// The end of an attempt inside a job of Slurm.
#pragma once

#include <filesystem>

#include "jobs/store/outcome/outcome.hpp"

namespace carillon::slurm {

/// Inside Slurm a request to save and stop means that the time limit is near: stopped becomes time_limit.
outcome::Outcome explain_stop(outcome::Outcome outcome);

/// After run_attempt() ended with `exit_code`: requeues a job that continues, with the back-off of its cause, unless Slurm itself is ending
/// it (cancelled, timeout, preempted). Returns the exit code for Slurm: the same, or 4 after too many failures. If Slurm refuses, the
/// submitting host hands the job over again. No effect outside Slurm.
int end_attempt(const std::filesystem::path& work, int exit_code);

}  // namespace carillon::slurm
