// What is asked of Slurm for a job.
#pragma once

#include <filesystem>

#include "jobs/registry/registry.hpp"
#include "jobs/slurm/settings.hpp"
#include "jobs/store/store.hpp"

namespace carillon::slurm {

/// As the job says; else ranks by the time that it will take on one (at most settings.max_ranks), memory as predicted for them. A job too
/// large to be guessed is predicted first by `program` attempt --predict, here; where that fails the guess has to do.
store::Resources find_resources(const store::Store& store, const registry::Job& job, const Settings& settings,
                                const std::filesystem::path& program);

}  // namespace carillon::slurm
