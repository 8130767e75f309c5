// Method:     As in queue/admission.hpp, for one job per machine.
#include "jobs/queue/slurm/needs.hpp"

#include <algorithm>
#include <cmath>

#include "jobs/queue/admission.hpp"
#include "jobs/queue/attempt/attempt.hpp"
#include "jobs/queue/needs.hpp"
#include "jobs/queue/slurm/command.hpp"
#include "precompute/job/cost/calibration.hpp"
#include "runtime/base/host.hpp"

namespace carillon::slurm {
namespace {

constexpr double kPredictionPatienceS = 600.0;

void predict(const store::Store& store, const registry::Job& job, const queue::Need& guess, const std::filesystem::path& program) {
  const double memory_gb = queue::calc_memory(guess, 1);
  if (memory_gb > base::find_host().available_gb) return;
  attempt::Options attempt;
  attempt.work = store.work_folder(job.id);
  attempt.is_prediction = true;
  run_command(attempt::make_arguments(program, attempt), {}, kPredictionPatienceS);
}

double find_charged(const queue::Need& need, int ranks) {
  const double memory_gb = queue::calc_memory(need, ranks);
  return need.memory_gb > 0.0 ? memory_gb : cost::kChargedMargin * memory_gb + cost::kChargedGbPerProcess * (ranks + 1);
}

}  // namespace

Needs find_needs(const store::Store& store, const registry::Job& job, const queue::SlurmSettings& settings,
                 const std::filesystem::path& program) {
  queue::JobNeeds needs = queue::find_needs(store, job);
  if (needs.wants_prediction) {
    predict(store, job, needs.need, program);
    needs = queue::find_needs(store, job);
  }
  if (settings.has_pictures) needs.need.min_gb = std::max(needs.need.min_gb, attempt::kDrawGb);
  Needs found;
  store::Resources& resources = found.resources;
  resources.time_limit_s = needs.time_limit_s;
  resources.ranks = needs.need.ranks;
  if (resources.ranks <= 0) {
    const bool is_small = needs.need.seconds < queue::kSmallSeconds;
    const double worth = is_small ? 1.0 : std::floor(needs.need.seconds / queue::kSecondsPerRank);
    resources.ranks = static_cast<int>(std::clamp(worth, 1.0, static_cast<double>(settings.max_ranks)));
  }
  resources.memory_gb = find_charged(needs.need, resources.ranks);
  found.pack = {needs.need.seconds, needs.need.serial_seconds, {}, needs.need.ranks};
  for (int ranks = 1; ranks <= std::max(settings.max_ranks, resources.ranks); ranks *= 2)
    found.pack.memory_gb.push_back(find_charged(needs.need, ranks));
  found.is_short = !needs.is_simulation && needs.need.seconds < kShortSeconds;
  return found;
}

}  // namespace carillon::slurm
