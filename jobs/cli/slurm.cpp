#include "jobs/cli/slurm.hpp"

#include <fmt/core.h>
#include <time.h>

#include <algorithm>
#include <set>
#include <utility>
#include <vector>

#include "jobs/cli/follow.hpp"
#include "jobs/queue/display.hpp"
#include "jobs/queue/slurm/engine.hpp"
#include "jobs/queue/slurm/needs.hpp"
#include "jobs/store/process/process.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/base/command.hpp"

namespace carillon::cli {
namespace {

using registry::Job;
using registry::JobState;

constexpr long kStepNs = 200'000'000;

queue::SlurmSettings find_settings(Shared& shared) {
  queue::SlurmSettings settings = shared.profile().slurm;
  settings.has_pictures = settings.has_pictures || shared.has_pictures;
  return settings;
}

slurm::Engine& find_engine(Shared& shared) {
  if (!shared.slurm_engine) {
    shared.slurm_engine =
        std::make_shared<slurm::Engine>(shared.store(), find_settings(shared), base::find_self(),
                                        [](const std::string& line) { fmt::print(stderr, "carillon: {}\n", show_message(line)); });
  }
  return *shared.slurm_engine;
}

std::vector<Job> hand_over(Shared& shared) {
  return find_engine(shared).hand_over(
      shared.registry(), [&](const Job& job) { return slurm::find_needs(shared.store(), job, find_settings(shared), base::find_self()); });
}

}  // namespace

void check_slurm() {}

void follow_slurm(Shared& shared) {
  const double now_s = base::get_boot_s();
  if (shared.slurm_asked_s > 0.0 && now_s - shared.slurm_asked_s < shared.profile().slurm.poll_s) return;
  const std::vector<Job> cancelled = shared.registry().list({JobState::cancelled});
  const bool is_left = std::any_of(cancelled.begin(), cancelled.end(), [](const Job& job) { return !job.slurm_job.empty(); });
  if (!is_left && shared.registry().list_open(store::JobEngine::slurm).empty()) return;
  find_engine(shared).follow(shared.registry());
  shared.slurm_asked_s = base::get_boot_s();
}

std::size_t hand_over_to_slurm(Shared& shared) {
  const std::vector<Job> jobs = hand_over(shared);
  return std::count_if(jobs.begin(), jobs.end(), [](const Job& job) { return !job.slurm_job.empty(); });
}

queue::CommandResult cancel_in_slurm(Shared& shared, const store::Id& id) {
  const auto row = shared.registry().find(id);
  if (!row || !is_open(row->state)) return queue::request_cancel(shared.registry(), id);
  if (!find_engine(shared).cancel(shared.registry(), id))
    return {true, "Slurm is asked to end it; carillon status shows when it has ended"};
  const auto now = shared.registry().find(id);
  if (now && now->state == JobState::done) return {false, "it was done before it could be stopped; its bank stays"};
  return {true, "cancelled"};
}

int run_with_slurm(Shared& shared, const queue::RunOptions& options) {
  shared.has_pictures = options.attempt.has_pictures;
  queue::Display display(shared.json, options.quiet,
                         [&](const store::Id& id) { return store::read_progress(shared.store().work_folder(id)); });
  std::set<store::Id> worked;
  for (;;) {
    for (const Job& job : find_engine(shared).follow(shared.registry())) display.print_event(to_text(job.state), job);
    for (const Job& job : hand_over(shared)) display.print_event(job.state == JobState::failed ? "failed" : "queued", job);
    const std::vector<Job> open = shared.registry().list_open(store::JobEngine::slurm);
    for (const Job& job : open) worked.insert(job.id);
    display.show(open);
    if (open.empty() && !options.runner.keep) {
      std::vector<Job> ended;
      for (const store::Id& id : worked)
        if (auto job = shared.registry().find(id)) ended.push_back(std::move(*job));
      return find_exit_code(ended);
    }
    const double until_s = base::get_boot_s() + shared.profile().slurm.poll_s;
    while (base::get_boot_s() < until_s) {
      const timespec time{0, kStepNs};
      ::nanosleep(&time, nullptr);
    }
  }
}

}  // namespace carillon::cli
