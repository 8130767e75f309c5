// Jobs of the engine "slurm": handed to Slurm in batches, followed through Slurm's own commands, settled by what they left in the store.
//
// A row of theirs is running without a number while it is being handed over, queued with one while it waits in Slurm, running with one
// while it runs there. What was handed over stands in the job's folder too (records.hpp), so that nothing is submitted twice.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "jobs/store/outcome/outcome.hpp"
#include "jobs/store/registry/registry.hpp"
#include "jobs/queue/slurm/client.hpp"
#include "jobs/queue/slurm/needs.hpp"
#include "jobs/queue/slurm/records.hpp"
#include "jobs/queue/slurm/settings.hpp"
#include "jobs/store/store.hpp"

namespace carillon::slurm {

/// Hands jobs to Slurm and follows them. What was handed over is in the job's folder before sbatch is called, so that no job is submitted
/// twice, whenever this process ends.
class Engine {
 public:
  /// What is asked of Slurm for a job. Asked outside of transactions.
  using FindNeeds = std::function<Needs(const registry::Job&)>;

  /// `program`: carillon, unless the settings name it. `say`: lines about Slurm itself, e.g. that it does not answer.
  Engine(const store::Store& store, Settings settings, std::filesystem::path program, std::function<void(const std::string&)> say);

  /// Hands over all that is ready: short jobs packed into the tasks of one array (packing.hpp), of the others those that ask for the same
  /// in one array. What Slurm refuses has failed, and why is in its row; when Slurm does not answer they stay queued. Returns the rows that
  /// Slurm took or refused. Call follow() first.
  std::vector<registry::Job> hand_over(registry::Registry& registry, const FindNeeds& find_needs);

  /// Brings the rows up to date: waits, runs, ended and why, to be handed over again. Ends those that are to be cancelled. Rows stay as
  /// they are while Slurm does not answer. Returns those whose state changed.
  std::vector<registry::Job> follow(registry::Registry& registry);

  /// Cancels a job that Slurm has or may get: now when Slurm answers, else as soon as it does. False: later.
  bool cancel(registry::Registry& registry, const store::Id& id);

 private:
  using Rows = std::vector<registry::Job>;
  /// How the jobs of a batch lie in its tasks; none: a task each.
  struct Packed {
    std::vector<std::vector<Placed>> tasks;  // by indices into the jobs
    double memory_gb = 0.0;
  };
  Batch make_batch(std::size_t jobs) const;
  void submit(registry::Registry& registry, const Batch& batch, const Rows& jobs, const Packed* packed, Rows& changed);
  void submit_packed(registry::Registry& registry, const Machine& machine, int max_tasks, Rows jobs, const std::vector<Needs>& needs,
                     Rows& changed);
  void adopt(registry::Registry& registry, Rows& jobs);
  void look_at(registry::Registry& registry, const registry::Job& job, const SlurmStatus& seen, Rows& changed);
  void show_phase(registry::Registry& registry, const registry::Job& job, const SlurmStatus& seen, Rows& changed);
  void look_at_packed(registry::Registry& registry, const registry::Job& job, const SlurmStatus& seen, Rows& changed);
  void settle(registry::Registry& registry, const registry::Job& job, const std::optional<SlurmStatus>& seen, Rows& changed);
  void settle_ended(registry::Registry& registry, const registry::Job& job, const SubmittedJob& submitted,
                    const std::optional<SlurmStatus>& seen, Rows& changed);
  void end_unwanted(const Rows& jobs);
  void cancel_left(registry::Registry& registry);
  void clean();
  void show_unreachable(const Unreachable& error);

  const store::Store& store_;
  SlurmClient client_;
  std::filesystem::path program_;
  std::function<void(const std::string&)> say_;
  bool is_unreachable_shown_ = false;
};

/// What became of a job that Slurm has ended, from what it left in its folder and what Slurm says. Reads files only.
struct SlurmOutcome {
  bool is_cancelled = false;  // by scancel
  outcome::Outcome outcome;
};
SlurmOutcome judge(const store::Store& store, const store::Id& id, const SubmittedJob& submitted, const std::optional<SlurmStatus>& seen);

}  // namespace carillon::slurm
