// Slurm resources of a job.
#pragma once

#include <filesystem>

#include "jobs/queue/slurm/packing.hpp"
#include "jobs/queue/slurm_settings.hpp"
#include "jobs/store/registry/registry.hpp"
#include "jobs/store/store.hpp"

namespace carillon::slurm {

/// Limit of jobs for packing, on one rank.
inline constexpr double kShortSeconds = 600.0;

struct Needs {
  store::Resources resources;  // in its own task
  PackJob pack;                // in a shared task
  bool is_short = false;       // may be packed: a solve of less than kShortSeconds
};

/// As requested by the job; else ranks from the predicted time on one rank (at most settings.max_ranks), memory as predicted for them.
/// Large jobs are predicted by `program` attempt --predict on this host; if that fails the estimate is used.
Needs find_needs(const store::Store& store, const registry::Job& job, const queue::SlurmSettings& settings,
                 const std::filesystem::path& program);

}  // namespace carillon::slurm
