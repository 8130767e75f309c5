// Jobs of the engine "slurm": submitted to Slurm in batches, followed by Slurm's commands, settled by their outcomes in the store.
//
// A row is running without a Slurm job number while it is being submitted, queued with a number while pending, running with a number while
// running. The submission is also recorded in the job's folder (records.hpp), so that nothing is submitted twice.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "jobs/queue/slurm/client.hpp"
#include "jobs/queue/slurm/needs.hpp"
#include "jobs/queue/slurm/records.hpp"
#include "jobs/queue/slurm_settings.hpp"
#include "jobs/store/outcome/outcome.hpp"
#include "jobs/store/registry/registry.hpp"
#include "jobs/store/store.hpp"

namespace carillon::slurm {

/// Submits jobs to Slurm and follows them. A submission is recorded in the job's folder before sbatch is called, so that no job is
/// submitted twice even if this process is killed.
class Engine {
 public:
  /// Resources of a job. Called outside of transactions.
  using FindNeeds = std::function<Needs(const registry::Job&)>;

  /// `program`: path of carillon, unless set in the settings. `say`: messages about Slurm itself.
  Engine(const store::Store& store, queue::SlurmSettings settings, std::filesystem::path program,
         std::function<void(const std::string&)> say);

  /// Submits all ready jobs: short jobs packed into the tasks of one array (packing.hpp), others with equal resources in one array. Refused
  /// jobs fail with the reason; if Slurm does not answer, jobs stay queued. Returns accepted and refused rows. Call follow() first.
  std::vector<registry::Job> hand_over(registry::Registry& registry, const FindNeeds& find_needs);

  /// Updates the rows from Slurm and settles ended jobs; cancels jobs with cancel_wanted. Rows are unchanged while Slurm does not answer.
  /// Returns the rows whose state changed.
  std::vector<registry::Job> follow(registry::Registry& registry);

  /// Cancels a job: at once if Slurm answers, else by a later follow(). False: later.
  bool cancel(registry::Registry& registry, const store::Id& id);

 private:
  using Rows = std::vector<registry::Job>;
  /// Assignment of the jobs of a batch to tasks.
  struct Packed {
    std::vector<std::vector<Placed>> tasks;  // indices into the jobs
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

/// The outcome of a job that Slurm has ended, from its folder and its Slurm status. Reads files only.
struct SlurmOutcome {
  bool is_cancelled = false;  // by scancel
  outcome::Outcome outcome;
};
SlurmOutcome judge(const store::Store& store, const store::Id& id, const SubmittedJob& submitted, const std::optional<SlurmStatus>& seen);

}  // namespace carillon::slurm
