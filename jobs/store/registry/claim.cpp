#include <algorithm>

#include "jobs/store/registry/registry.hpp"

namespace carillon::registry {
namespace {

constexpr double kMaxWaitS = 600.0;

bool is_ready(const Job& job, const std::string& boot, double now_s) {
  if (job.state != JobState::waiting) return job.state == JobState::queued;
  // Beyond the longest wait: written by another clock (e.g. of a container).
  return job.ready_boot_id != boot || job.ready_boot_s <= now_s || job.ready_boot_s > now_s + kMaxWaitS;
}

}  // namespace

std::vector<Job> JobTable::list_open(store::JobEngine engine) const {
  std::vector<Job> jobs = list({JobState::queued, JobState::running, JobState::waiting});
  std::erase_if(jobs, [&](const Job& job) { return job.engine != engine; });
  return jobs;
}

std::vector<Job> calc_claims(const std::vector<Job>& open, const ClaimTerms& terms, const JobTable::Choose& choose) {
  std::vector<Job> running, ready, changed;
  for (const Job& job : open) {
    if (job.state == JobState::running)
      running.push_back(job);
    else if (job.engine == terms.engine && ready.size() < terms.max && is_ready(job, terms.boot_id, terms.now_boot_s))
      ready.push_back(job);
  }
  for (Job job : choose(running, ready)) {
    const auto is_same = [&](const Job& other) { return other.id == job.id; };
    if (std::none_of(ready.begin(), ready.end(), is_same) || std::any_of(changed.begin(), changed.end(), is_same)) continue;
    if (terms.has_bank(job.id)) {
      job.state = JobState::done;
      job.reason.clear();
      job.ended_unix_s = find_unix_seconds();
    } else {
      job.state = JobState::running;
      job.token = store::make_random_name();
      job.worker = terms.worker;
      job.slurm_job.clear();
      job.attempts += 1;
      job.started_unix_s = find_unix_seconds();
      job.ended_unix_s = 0.0;
    }
    changed.push_back(std::move(job));
  }
  return changed;
}

}  // namespace carillon::registry
