// carillon run and carillon attempt.
#include "jobs/queue/run.hpp"

#include "jobs/cli/commands.hpp"
#include "jobs/cli/follow.hpp"
#include "jobs/cli/slurm.hpp"
#include "jobs/queue/attempt/attempt.hpp"
#include "jobs/queue/local.hpp"
#include "jobs/queue/settle.hpp"
#include "jobs/queue/slurm/inside.hpp"
#include "runtime/base/command.hpp"
#include "runtime/base/error.hpp"

namespace carillon::cli {
namespace fs = std::filesystem;

void Shared::settle() {
  if (!store().may_write() || is_disk_full_) {
    registry_.reset();
    return;
  }
  registry();
  if (is_disk_full_) return;
  try {
    queue::settle(queue::LocalEnvironment(store()), registry());
    follow_slurm(*this);
    if (hands_over) hand_over_to_slurm(*this);
  } catch (const SystemError& error) {
    if (!fall_back(error)) throw;
  }
}

int run_until_done(Shared& shared, const std::vector<store::Id>& ids, bool has_pictures, bool is_quiet) {
  queue::RunOptions options;
  options.attempt.has_pictures = has_pictures;
  options.attempt.program = base::find_self();
  options.quiet = shared.json || is_quiet;
  options.attempt.mpirun_options = shared.profile().mpirun_options;
  if (const int code = queue::run(shared.store(), options); code != 0 && code != kExitSolve)
    return code;  // 3: some job failed, not necessarily one of these
  std::vector<registry::Job> jobs;
  for (const store::Id& id : ids) {
    if (auto job = shared.registry().find(id)) jobs.push_back(std::move(*job));
  }
  return find_exit_code(jobs);
}

int run_queue(Shared& shared, const QueueOptions& options) {
  if (options.engine == "slurm") return run_with_slurm(shared, options.queue);
  queue::RunOptions wanted = options.queue;
  wanted.attempt.mpirun_options = shared.profile().mpirun_options;
  wanted.attempt.program = base::find_self();
  wanted.json = shared.json;
  return queue::run(shared.store(), wanted);
}

int run_attempt(const AttemptOptions& options) {
  attempt::Options wanted = options.attempt;
  if (options.launcher == "alone") wanted.launcher = attempt::Launcher::alone;
  if (options.launcher == "mpirun") wanted.launcher = attempt::Launcher::mpirun;
  if (options.launcher == "srun") wanted.launcher = attempt::Launcher::srun;
  if (!wanted.token.empty() && (wanted.token.size() != 32 || wanted.token.find_first_not_of("0123456789abcdef") != std::string::npos))
    throw InputError("--token: 32 hex digits are needed");
  const int code = attempt::run_attempt(wanted);
  return options.engine == "slurm" ? slurm::end_attempt(wanted.work, code) : code;
}

}  // namespace carillon::cli
