// Commands for Slurm in a build without the component SLURM.
#include "jobs/cli/slurm.hpp"
#include "runtime/base/component.hpp"

namespace carillon::cli {
void check_slurm() { base::refuse_missing("a job on \"slurm\"", "SLURM"); }

void follow_slurm(Shared&) {}

std::size_t hand_over_to_slurm(Shared&) {
  check_slurm();
  return 0;
}

queue::CommandResult cancel_in_slurm(Shared&, const store::Id&) {
  check_slurm();
  return {};
}

int run_with_slurm(Shared&, const queue::RunOptions&) {
  check_slurm();
  return 0;
}

}  // namespace carillon::cli
