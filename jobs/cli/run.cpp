// carillon run: the queue of this machine; and carillon attempt, which it and the scripts of Slurm start.
#include "jobs/queue/run.hpp"

#include <fmt/core.h>

#include "jobs/attempt/attempt.hpp"
#include "jobs/cli/follow.hpp"
#include "jobs/cli/options.hpp"
#include "jobs/cli/shared.hpp"
#include "jobs/cli/slurm.hpp"
#include "jobs/queue/local.hpp"
#include "jobs/queue/settle.hpp"
#include "jobs/slurm/inside.hpp"
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

int run_until_done(Shared& shared, const std::vector<store::Id>& ids, bool has_pictures) {
  queue::RunOptions options;
  options.attempt.has_pictures = has_pictures;
  options.attempt.program = base::find_self();
  options.quiet = shared.json;
  options.attempt.mpirun_options = shared.profile().mpirun_options;
  if (const int code = queue::run(shared.store(), options); code != 0) return code;
  std::vector<registry::Job> jobs;
  for (const store::Id& id : ids) {
    if (auto job = shared.registry().find(id)) jobs.push_back(std::move(*job));
  }
  return find_exit_code(jobs);
}

void add_run(CLI::App& app, Shared& shared, Run& run) {
  auto options = std::make_shared<queue::RunOptions>();
  CLI::App* command = app.add_subcommand("run",
                                         "Works through the queue on this machine until it is empty: as many jobs at once as cores and "
                                         "memory allow. Any number may run on one store.\n"
                                         "Ctrl-C saves what runs and puts it back into the queue; once more ends it. Exit code 0: the "
                                         "queue is empty, whatever became of single jobs.");
  command->add_flag("--keep", options->runner.keep, "Stay and wait for more jobs when the queue is empty");
  command->add_option("--cores", options->runner.cores, "Use at most so many")->check(CLI::Range(1, 1'000'000));
  command->add_option("--memory-gb", options->runner.memory_gb, "Use at most so much")->check(make_gb_check(1e-3));
  command->add_flag("-q,--quiet", options->quiet, "Print nothing");
  command->add_flag("--pictures", options->attempt.has_pictures,
                    "Draw the first modes of each bank for its report at once, not when the report is asked for");
  auto engine = std::make_shared<std::string>("local");
  command->add_option("--on", *engine, "local: the queue of this machine; slurm: hand over to Slurm and follow, until all have ended")
      ->check(CLI::IsMember({"local", "slurm"}));
  command->callback([&shared, &run, options, engine] {
    run = [&shared, options, engine] {
      if (*engine == "slurm") {
        run_with_slurm(shared, *options);
        return 0;
      }
      options->attempt.mpirun_options = shared.profile().mpirun_options;
      options->attempt.program = base::find_self();
      options->json = shared.json;
      return queue::run(shared.store(), *options);
    };
  });
}

void add_attempt(CLI::App& app, Run& run) {
  auto options = std::make_shared<attempt::Options>();
  auto launcher = std::make_shared<std::string>();
  CLI::App* command =
      app.add_subcommand("attempt", "One attempt at the job of a folder of work, for carillon run and the scripts of Slurm")->group("");
  command->add_option("WORK", options->work, "work/ab/ID of a store")->required();
  command->add_option("--ranks", options->ranks)->check(CLI::Range(1, 1'000'000));
  command->add_option("--memory-gb", options->memory_gb);
  command->add_option("--time-limit-s", options->time_limit_s);
  command->add_option("--token", options->token);
  command->add_option("--mpirun-option", options->mpirun_options, "A word for mpirun; can be given many times")->allow_extra_args(false);
  auto engine = std::make_shared<std::string>("local");
  command->add_option("--engine", *engine)->check(CLI::IsMember({"local", "slurm"}));
  command->add_option("--launcher", *launcher)->check(CLI::IsMember({"alone", "mpirun", "srun"}));
  command->add_flag("--predict", options->is_prediction);
  command->add_flag("--pictures", options->has_pictures);
  command->add_option("--grace-s", options->grace_s);
  command->add_option("--hang-s", options->hang_s);
  command->callback([&run, options, launcher, engine] {
    run = [options, launcher, engine] {
      if (*launcher == "alone") options->launcher = attempt::Launcher::alone;
      if (*launcher == "mpirun") options->launcher = attempt::Launcher::mpirun;
      if (*launcher == "srun") options->launcher = attempt::Launcher::srun;
      if (!options->token.empty() &&
          (options->token.size() != 32 || options->token.find_first_not_of("0123456789abcdef") != std::string::npos))
        throw InputError("--token: 32 hex digits are needed");
      const int code = attempt::run_attempt(*options);
      return *engine == "slurm" ? slurm::end_attempt(options->work, code) : code;
    };
  });
}

}  // namespace carillon::cli
