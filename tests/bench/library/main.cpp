// A library of small bodies on a cluster: packed from what was predicted, run with what was recorded.
//
// usage: bench_library RECORD NODES CORES START_S ATTEMPT_S [TASKS [SEED]]
//
// RECORD is made by tests/bench/library/record. 10,000 jobs are drawn from it. START_S: what a task takes to start in
// Slurm; ATTEMPT_S: what the store takes of each job (process, checks, report). TASKS: so many tasks in place of what plan_packs() chooses;
// 0: one task a job, as without packing; -1: its choice. Prints one JSON object; tests/bench/library/run makes tables and picture.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <queue>
#include <random>
#include <string>
#include <vector>

#include "jobs/queue/slurm/packing.hpp"
#include "runtime/base/document.hpp"
#include "runtime/base/json.hpp"

namespace {

using namespace carillon;
using slurm::PackJob;
using slurm::PackPlan;
using slurm::Placed;

constexpr std::size_t kJobs = 10000;
constexpr double kNodeGbPerCore = 4.0;
constexpr double kChargedMargin = 1.2 * 1.1, kChargedGb = 0.2;  // as jobs/queue/slurm/needs.cpp asks for a body of one rank

struct Body {
  PackJob predicted;
  double cpu_s = 0.0;         // recorded, on one rank
  double serial_share = 0.0;  // of it, recorded on one and two ranks, else as predicted
};

std::vector<Body> read_bodies(const std::string& file) {
  base::Document document = base::read_document(file);
  base::Object root = document.root();
  std::vector<Body> bodies;
  for (base::Object& row : root.objects("bodies")) {
    Body body;
    body.predicted.seconds = row.number("predicted_s");
    body.predicted.serial_s = row.number("predicted_serial_s");
    for (const double gb : row.number_list("predicted_gb", 10)) body.predicted.memory_gb.push_back(kChargedMargin * gb + kChargedGb);
    body.cpu_s = row.number("cpu_s");
    body.serial_share = body.predicted.serial_s / body.predicted.seconds;
    if (row.has("wall_of_ranks_s")) {
      const auto wall_s = row.numbers<2>("wall_of_ranks_s");
      body.serial_share = std::clamp((2.0 * wall_s[1] - wall_s[0]) / wall_s[0], 0.0, 1.0);
    }
    bodies.push_back(body);
  }
  return bodies;
}

/// Where core seconds went.
struct Account {
  double makespan_s = 0.0;
  double work_s = 0.0;     // of solves, as on one rank
  double ranks_s = 0.0;    // what several ranks take beyond that
  double attempt_s = 0.0;  // store and report
  double start_s = 0.0;    // Slurm
  std::size_t jobs = 0;
};

/// Tasks start in the order of the array, each on the node that has its cores first.
class Cluster {
 public:
  Cluster(int nodes, int cores) { free_s_.assign(nodes, std::vector<double>(cores, 0.0)); }

  /// Returns its end.
  double run(std::size_t cores, double seconds) {
    const auto find_start = [&](const std::vector<double>& node) { return node[cores - 1]; };  // sorted
    auto node =
        std::min_element(free_s_.begin(), free_s_.end(), [&](const auto& a, const auto& b) { return find_start(a) < find_start(b); });
    const double end_s = find_start(*node) + seconds;
    std::fill_n(node->begin(), cores, end_s);
    std::sort(node->begin(), node->end());
    return end_s;
  }

 private:
  std::vector<std::vector<double>> free_s_;  // of each core of each node
};

double calc_wall(const Body& body, int ranks) { return body.cpu_s * (body.serial_share + (1.0 - body.serial_share) / ranks); }

}  // namespace

int main(int argc, char** argv) {
  try {
    if (argc < 6) throw InputError("usage: bench_library RECORD NODES CORES START_S ATTEMPT_S [TASKS [SEED]]");
    const std::vector<Body> bodies = read_bodies(argv[1]);
    const int nodes = std::atoi(argv[2]), cores = std::atoi(argv[3]);
    const double start_s = std::atof(argv[4]), attempt_s = std::atof(argv[5]);
    const int tasks = argc > 6 ? std::atoi(argv[6]) : -1;
    if (bodies.empty() || nodes < 1 || cores < 1) throw InputError("bodies, nodes and cores are needed");

    std::mt19937 random(argc > 7 ? static_cast<unsigned>(std::atoi(argv[7])) : 1u);
    std::vector<const Body*> library;
    std::vector<PackJob> jobs;
    double cpu_s = 0.0, predicted_s = 0.0;
    for (std::size_t i = 0; i < kJobs; ++i) {
      library.push_back(&bodies[random() % bodies.size()]);
      jobs.push_back(library.back()->predicted);
      cpu_s += library.back()->cpu_s;
      predicted_s += library.back()->predicted.seconds;
    }

    slurm::PackTerms terms;
    const slurm::Machine machine{nodes, cores, kNodeGbPerCore * cores};
    if (tasks > 0) {
      terms.start_s = 1e-9;
      terms.longest_s = 1e-6;
      terms.max_tasks = tasks;
    }
    PackPlan plan;
    if (tasks == 0) {
      for (std::size_t i = 0; i < jobs.size(); ++i) plan.tasks.push_back({{i, 1, jobs[i].memory_gb[0], jobs[i].seconds}});
    } else {
      plan = slurm::plan_packs(jobs, machine, terms);
    }

    Account account;
    Cluster cluster(nodes, cores);
    std::vector<int> runs(kJobs, 0);
    const auto find_seconds = [&](const Placed& placed) { return attempt_s + calc_wall(*library[placed.job], placed.ranks); };
    double first_end_s = INFINITY, task_s = 0.0;
    int most_ranks = 1;
    for (const std::vector<Placed>& task : plan.tasks) {
      double seconds = 0.0;
      for (const slurm::Span& span : slurm::replay(task, plan.cores, plan.memory_gb, find_seconds)) {
        const Body& body = *library[span.job];
        runs[span.job] += 1;
        account.jobs += 1;
        account.work_s += body.cpu_s;
        account.attempt_s += attempt_s * span.ranks;
        account.ranks_s += span.ranks * (span.end_s - span.start_s - attempt_s) - body.cpu_s;
        most_ranks = std::max(most_ranks, span.ranks);
        seconds = std::max(seconds, span.end_s);
      }
      account.start_s += start_s * plan.cores;
      task_s += plan.cores * (start_s + seconds);
      const double end_s = cluster.run(static_cast<std::size_t>(plan.cores), start_s + seconds);
      account.makespan_s = std::max(account.makespan_s, end_s);
      first_end_s = std::min(first_end_s, end_s);
    }
    const bool is_each_once = std::all_of(runs.begin(), runs.end(), [](int count) { return count == 1; });
    if (!is_each_once || std::abs(account.work_s - cpu_s) > 1e-6 * cpu_s)
      throw SystemError("a job or CPU seconds were lost, or counted twice");

    const double all_s = account.makespan_s * nodes * cores;
    base::Json out = base::Json::object();
    out.set("jobs", static_cast<long long>(account.jobs)).set("tasks", static_cast<long long>(plan.tasks.size())).set("cores", plan.cores);
    out.set("cpu_s", cpu_s).set("predicted_s", predicted_s).set("makespan_s", account.makespan_s).set("planned_s", plan.seconds);
    out.set("planned_idle_share", plan.idle_share).set("most_ranks", most_ranks);
    out.set("idle_share", 1.0 - cpu_s / all_s).set("idle_share_of_tasks", 1.0 - cpu_s / task_s);
    out.set("start_share", account.start_s / all_s)
        .set("attempt_share", account.attempt_s / all_s)
        .set("ranks_share", account.ranks_s / all_s);
    fmt::print("{}\n", out.line());
    return 0;
  } catch (const std::exception& error) {
    fmt::print(stderr, "bench_library: {}\n", error.what());
    return 1;
  }
}
