// Method:     Longest processing time first, by area (ranks times seconds) or by memory, whichever fills a task sooner; list scheduling
//             inside a task.
// Source:     Graham, Bounds on multiprocessing timing anomalies, SIAM J. Appl. Math. 17, 1969; here with jobs of several ranks.
#include "jobs/queue/slurm/packing.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <queue>
#include <utility>

namespace carillon::slurm {
namespace {

constexpr double kStartsWorth = 20.0;    // minimum duration of a task / its start time
constexpr double kLongestShare = 0.5;    // maximum share of one job in the time of a task
constexpr double kSecondsPerRank = 2.0;  // minimum work per rank
constexpr double kMemoryMargin = 1.25;   // for a start order other than predicted
constexpr double kInfinity = std::numeric_limits<double>::infinity();

double find_memory(const PackJob& job, int ranks) {
  if (job.memory_gb.empty()) return 0.0;
  const std::size_t place = std::ceil(std::log2(std::max(1, ranks)));
  return job.memory_gb[std::min(place, job.memory_gb.size() - 1)];
}

double sum_seconds(const std::vector<PackJob>& jobs) {
  return std::accumulate(jobs.begin(), jobs.end(), 0.0, [](double sum, const PackJob& job) { return sum + job.seconds; });
}

std::size_t count_tasks(const std::vector<PackJob>& jobs, double work_s, const Machine& machine, const PackTerms& terms) {
  const double node_s = work_s / machine.cores;  // on one node
  const double rounds = std::max(1.0, std::ceil(node_s / machine.nodes / terms.longest_s));
  const double worth = std::max(1.0, std::floor(node_s / (kStartsWorth * terms.start_s)));
  const double max = std::min(static_cast<double>(std::max(1, terms.max_tasks)), static_cast<double>(jobs.size()));
  return std::min({machine.nodes * rounds, worth, max});
}

/// The smallest worthwhile number of ranks within `limit_s`.
int choose_ranks(const PackJob& job, double limit_s, int cores, int max_ranks) {
  if (job.ranks > 0) return std::min(job.ranks, cores);
  int ranks = 1;
  while (calc_wall_s(job, ranks) > limit_s && 2 * ranks <= std::min(cores, max_ranks) && job.seconds / (2 * ranks) >= kSecondsPerRank)
    ranks *= 2;
  return ranks;
}

double find_end(const std::vector<Span>& spans) {
  double end_s = 0.0;
  for (const Span& span : spans) end_s = std::max(end_s, span.end_s);
  return end_s;
}

/// Peak memory of concurrent jobs.
double find_peak(const std::vector<Placed>& task, const std::vector<Span>& spans) {
  std::vector<std::pair<double, double>> changes;  // at equal times ends come first
  for (const Span& span : spans) {
    const auto placed = std::find_if(task.begin(), task.end(), [&](const Placed& other) { return other.job == span.job; });
    changes.emplace_back(span.start_s, placed->memory_gb);
    changes.emplace_back(span.end_s, -placed->memory_gb);
  }
  std::sort(changes.begin(), changes.end());
  double now_gb = 0.0, peak_gb = 0.0;
  for (const auto& [time_s, change_gb] : changes) peak_gb = std::max(peak_gb, now_gb += change_gb);
  return peak_gb;
}

}  // namespace

double calc_wall_s(const PackJob& job, int ranks) {
  const double serial_s = std::min(job.serial_s, job.seconds);
  return serial_s + (job.seconds - serial_s) / std::max(1, ranks);
}

std::optional<std::size_t> choose_next(const std::vector<Placed>& waiting, const Room& room) {
  for (std::size_t i = 0; i < waiting.size(); ++i) {
    if (waiting[i].ranks > room.cores) return std::nullopt;
    if (waiting[i].memory_gb <= room.memory_gb) return i;
  }
  return std::nullopt;
}

std::vector<Span> replay(const std::vector<Placed>& task, int cores, double memory_gb,
                         const std::function<double(const Placed&)>& find_seconds) {
  struct Running {
    double end_s;
    int ranks;
    double memory_gb;
    bool operator<(const Running& other) const { return end_s > other.end_s; }
  };
  std::vector<Placed> waiting = task;
  std::priority_queue<Running> running;
  Room room{cores, memory_gb > 0.0 ? memory_gb : kInfinity};
  std::vector<Span> spans;
  double now_s = 0.0;
  while (!waiting.empty()) {
    const std::optional<std::size_t> next = choose_next(waiting, room);
    if (!next && running.empty()) break;  // larger than the task
    if (!next) {
      now_s = running.top().end_s;
      room.cores += running.top().ranks;
      room.memory_gb += running.top().memory_gb;
      running.pop();
      continue;
    }
    const Placed job = waiting[*next];
    waiting.erase(waiting.begin() + static_cast<std::ptrdiff_t>(*next));
    const double seconds = find_seconds(job);
    room.cores -= job.ranks;
    room.memory_gb -= job.memory_gb;
    running.push({now_s + seconds, job.ranks, job.memory_gb});
    spans.push_back({job.job, job.ranks, now_s, now_s + seconds});
  }
  return spans;
}

PackPlan plan_packs(const std::vector<PackJob>& jobs, const Machine& machine, const PackTerms& terms) {
  PackPlan plan;
  if (jobs.empty()) return plan;
  const double work_s = sum_seconds(jobs);
  const std::size_t count = count_tasks(jobs, work_s, machine, terms);
  const double limit_s = kLongestShare * work_s / (static_cast<double>(count) * machine.cores);
  std::vector<Placed> all;
  for (std::size_t i = 0; i < jobs.size(); ++i) {
    const int ranks = choose_ranks(jobs[i], limit_s, machine.cores, terms.max_ranks);
    all.push_back({i, ranks, find_memory(jobs[i], ranks), calc_wall_s(jobs[i], ranks)});
  }
  std::stable_sort(all.begin(), all.end(), [](const Placed& a, const Placed& b) { return a.seconds * a.ranks > b.seconds * b.ranks; });

  struct Load {
    double core_s = 0.0, memory_gb_s = 0.0;
    std::size_t jobs = 0;
  };
  plan.tasks.resize(count);
  std::vector<Load> loads(count);
  const auto calc_fill = [&](const Load& load) {
    const double by_memory = machine.memory_gb > 0.0 ? load.memory_gb_s / machine.memory_gb : 0.0;
    return std::make_pair(std::max(load.core_s / machine.cores, by_memory), load.jobs);
  };
  for (const Placed& placed : all) {
    const auto least =
        std::min_element(loads.begin(), loads.end(), [&](const Load& a, const Load& b) { return calc_fill(a) < calc_fill(b); });
    plan.tasks[least - loads.begin()].push_back(placed);
    least->core_s += placed.ranks * placed.seconds;
    least->memory_gb_s += placed.memory_gb * placed.seconds;
    least->jobs += 1;
  }

  // All tasks of an array have the same size.
  int cores = 1;
  for (std::vector<Placed>& task : plan.tasks) {
    std::stable_sort(task.begin(), task.end(), [](const Placed& a, const Placed& b) {
      return std::make_pair(a.ranks, a.seconds) > std::make_pair(b.ranks, b.seconds);
    });
    int wanted = 0;
    for (const Placed& placed : task) wanted = std::min(machine.cores, wanted + placed.ranks);
    cores = std::max(cores, wanted);
  }
  plan.cores = cores;
  double sum_s = 0.0;
  for (const std::vector<Placed>& task : plan.tasks) {
    const std::vector<Span> spans = replay(task, cores, machine.memory_gb, [](const Placed& placed) { return placed.seconds; });
    const double seconds = terms.start_s + find_end(spans);
    sum_s += seconds;
    plan.seconds = std::max(plan.seconds, seconds);
    plan.memory_gb = std::max(plan.memory_gb, kMemoryMargin * find_peak(task, spans));
    for (const Placed& placed : task) plan.memory_gb = std::max(plan.memory_gb, placed.memory_gb);
  }
  if (machine.memory_gb > 0.0) plan.memory_gb = std::min(plan.memory_gb, machine.memory_gb);
  plan.idle_share = 1.0 - work_s / (cores * sum_s);
  return plan;
}

}  // namespace carillon::slurm
