// Settings for Slurm at one site: the object "slurm" of the profile file. docs/howto/slurm.md
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "runtime/base/document.hpp"

namespace carillon::queue {

struct SlurmSettings {
  std::string partition, account, qos;      // empty: default of Slurm
  std::string launcher = "mpirun";          // or "srun": starts the ranks inside the allocation
  double signal_before_s = 120.0;           // time of the signal to save before the time limit
  int max_ranks = 16;                       // of a job without a request
  int max_running = 0;                      // tasks of one array at a time; 0: no limit
  int max_in_array = 1000;                  // limit of tasks per array, also limited by the site
  bool packs = true;                        // short jobs share tasks (packing.hpp)
  int pack_nodes = 0, pack_cores = 0;       // concurrent tasks and cores of each for packing; 0: nodes from sinfo
  double pack_minutes = 30.0;               // target duration of a task
  std::vector<std::string> options;         // arguments of sbatch: {"--constraint=zen3"}
  std::vector<std::string> prologue;        // shell lines at the start of every job: "module load openmpi"
  std::vector<std::string> mpirun_options;  // arguments of mpirun or srun, from "mpirun_options" of the profile
  bool has_pictures = false;                // draw the first modes for the report of each bank
  double poll_s = 10.0;                     // minimum interval of queries by one command
  std::string program;                      // path of carillon on the nodes; empty: the submitting program
};

/// InputError "file:line: ...". Without `object` all defaults.
SlurmSettings read_slurm_settings(std::optional<base::Object> object);

}  // namespace carillon::queue
