// Settings for Slurm at one site: the object "slurm" of the profile file. docs/howto/slurm.md
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "runtime/base/document.hpp"

namespace carillon::slurm {

struct Settings {
  std::string partition, account, qos;  // empty: Slurm's default
  std::string launcher = "mpirun";      // or "srun": how the ranks are started inside the allocation
  double signal_before_s = 120.0;       // this long before the time limit the job gets the signal to save
  int max_ranks = 16;                   // of a job that does not ask
  int max_running = 0;                  // tasks of one array at a time; 0: no limit
  int max_in_array = 1000;              // longer batches become several arrays; never more than the site allows
  bool packs = true;                    // short jobs share tasks (packing.hpp)
  int pack_nodes = 0, pack_cores = 0;   // tasks at a time and cores of each to plan for; 0: nodes, as sinfo says
  double pack_minutes = 30.0;           // of a task, about
  std::vector<std::string> options;     // words for sbatch, before ours: {"--constraint=zen3"}
  std::vector<std::string> prologue;    // lines of shell at the start of every job: "module load openmpi". The profile is the user's own.
  std::vector<std::string> mpirun_options;  // words for mpirun or srun, from the profile's own "mpirun_options"
  bool has_pictures = false;                // draw the first modes for the report of each bank when it is done
  double poll_s = 10.0;                     // Slurm is not asked more often by one command that waits
  std::string program;                      // carillon as the nodes know it; empty: the one that submits
};

/// Throws InputError "file:line: ...". `object` may be none: all defaults.
Settings read_settings(std::optional<base::Object> object);

}  // namespace carillon::slurm
