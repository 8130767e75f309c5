// The parts of Slurm jobs that other folders call, in a build without the component SLURM.
#include "jobs/queue/slurm/inside.hpp"
#include "jobs/queue/slurm/task.hpp"
#include "runtime/base/component.hpp"

namespace carillon::slurm {

int end_attempt(const std::filesystem::path&, int) { base::refuse_missing("an attempt in Slurm", "SLURM"); }
int run_task(const TaskOptions&) { base::refuse_missing("a task in Slurm", "SLURM"); }

}  // namespace carillon::slurm
