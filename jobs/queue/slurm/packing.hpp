// Packing of short jobs into the tasks of an array: tasks, ranks and start order. Pure functions.
//
// One task per node; more if a task would exceed `longest_s`, fewer if the start of a task would be a significant part of it. A job gets
// one rank, and more if it would take too large a part of the task's time on one. Jobs go, longest first, to the task with the least load.
// Inside a task a job starts as soon as its cores are free, wide jobs first, then long ones, so that a wrong prediction extends a task by
// only a part of one short job.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

namespace carillon::slurm {

/// Input of the packing.
struct PackJob {
  double seconds = 0.0;           // CPU time on one rank, predicted
  double serial_s = 0.0;          // serial part
  std::vector<double> memory_gb;  // on 1, 2, 4 ... ranks; empty: unknown
  int ranks = 0;                  // requested; 0: chosen here
};

/// Predicted wall time on `ranks` cores.
double calc_wall_s(const PackJob& job, int ranks);

/// A group of equal nodes.
struct Machine {
  int nodes = 1;
  int cores = 1;           // of a node
  double memory_gb = 0.0;  // of a node; 0: unknown
};

struct PackTerms {
  double start_s = 1.0;       // time of Slurm to start a task: tests/bench/library/slurm
  double longest_s = 1800.0;  // limit of a task, unless max_tasks is reached
  int max_tasks = 1000;       // of an array
  int max_ranks = 16;         // of a job without a request
};

/// A job in its task.
struct Placed {
  std::size_t job = 0;  // index into the packed jobs
  int ranks = 1;
  double memory_gb = 0.0;
  double seconds = 0.0;  // predicted wall time
};

struct PackPlan {
  int cores = 1;                           // of every task
  double memory_gb = 0.0;                  // of every task; 0: unknown
  std::vector<std::vector<Placed>> tasks;  // jobs in start order
  double seconds = 0.0;                    // of the longest task, predicted
  double idle_share = 0.0;                 // predicted idle share of all cores, including task starts
};

/// Assigns every job to one task. Requires `machine.cores` and `machine.nodes` >= 1, and no job with more ranks than a node has cores.
PackPlan plan_packs(const std::vector<PackJob>& jobs, const Machine& machine, const PackTerms& terms);

/// Free resources of a task.
struct Room {
  int cores = 0;
  double memory_gb = 0.0;  // infinite if unknown
};

/// The next of `waiting` to start; none: wait for a running job. A job may overtake one that lacks memory, but not one that lacks cores.
std::optional<std::size_t> choose_next(const std::vector<Placed>& waiting, const Room& room);

/// Start and end of a job in its task.
struct Span {
  std::size_t job = 0;
  int ranks = 1;
  double start_s = 0.0, end_s = 0.0;
};

/// Simulates the run of one task with durations from `find_seconds`. `memory_gb` 0: unknown.
std::vector<Span> replay(const std::vector<Placed>& task, int cores, double memory_gb,
                         const std::function<double(const Placed&)>& find_seconds);

}  // namespace carillon::slurm
