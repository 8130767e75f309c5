// What is asked of Slurm for a job.
#pragma once

#include <filesystem>

#include "jobs/store/registry/registry.hpp"
#include "jobs/queue/slurm/packing.hpp"
#include "jobs/queue/slurm/settings.hpp"
#include "jobs/store/store.hpp"

namespace carillon::slurm {

/// A body that takes longer on one rank has a task of its own.
inline constexpr double kShortSeconds = 600.0;

struct Needs {
  store::Resources resources;  // in a task of its own
  PackJob pack;                // in a task with others
  bool is_short = false;       // may be packed: a solve of less than kShortSeconds
};

/// As the job says; else ranks by the time that it will take on one (at most settings.max_ranks), memory as predicted for them. A job too
/// large to be guessed is predicted first by `program` attempt --predict, here; where that fails the guess has to do.
Needs find_needs(const store::Store& store, const registry::Job& job, const Settings& settings, const std::filesystem::path& program);

}  // namespace carillon::slurm
