// Which jobs share a task of an array, on how many ranks each, and in what order they start there. Pure: no clock, no disk, no Slurm.
//
// Tasks take whole nodes, as many as run at a time; more where one would be longer than `longest_s`, fewer where Slurm's start of a task
// would be a part worth counting. A job gets one rank, and more when it would take too large a part of its task's time on one. Jobs go, the
// longest first, to the task that has least to do. Inside a task a job starts as soon as there are cores for it, wide ones first, then the
// longest: a wrong prediction makes a task longer by a part of one short job.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

namespace carillon::slurm {

/// A job as packing sees it.
struct PackJob {
  double seconds = 0.0;           // CPU, on one rank, predicted
  double serial_s = 0.0;          // of them, what does not fall with ranks
  std::vector<double> memory_gb;  // on 1, 2, 4 ... ranks, beyond them the last; empty: not known
  int ranks = 0;                  // asked for; 0: chosen here
};

/// Predicted wall clock on so many ranks with a core each.
double calc_wall_s(const PackJob& job, int ranks);

/// Nodes that are alike.
struct Machine {
  int nodes = 1;
  int cores = 1;           // of a node
  double memory_gb = 0.0;  // of a node; 0: not known
};

struct PackTerms {
  double start_s = 1.0;       // what Slurm takes to start a task: tests/bench/library/slurm
  double longest_s = 1800.0;  // of a task, unless the array cannot have as many tasks as that needs
  int max_tasks = 1000;       // of an array
  int max_ranks = 16;         // of a job that does not ask
};

/// A job in its task.
struct Placed {
  std::size_t job = 0;  // its index among those that were packed
  int ranks = 1;
  double memory_gb = 0.0;
  double seconds = 0.0;  // wall clock, predicted
};

struct PackPlan {
  int cores = 1;                           // of every task
  double memory_gb = 0.0;                  // of every task; 0: not known
  std::vector<std::vector<Placed>> tasks;  // their jobs in the order in which they start
  double seconds = 0.0;                    // of the longest task, predicted
  double idle_share = 0.0;                 // predicted, of the cores of all tasks, Slurm's starts included
};

/// Every job is in one task. No jobs: no tasks. `machine.cores` and `machine.nodes` are at least 1; a job that asks for more ranks than a
/// node has cores is no job for packing.
PackPlan plan_packs(const std::vector<PackJob>& jobs, const Machine& machine, const PackTerms& terms);

/// What is free of a task.
struct Room {
  int cores = 0;
  double memory_gb = 0.0;  // infinite where it is not known
};

/// The next of `waiting` to start; none: what runs must end first. A job may pass one that waits for memory, and none that waits for cores.
std::optional<std::size_t> choose_next(const std::vector<Placed>& waiting, const Room& room);

/// When a job starts and ends in its task.
struct Span {
  std::size_t job = 0;
  int ranks = 1;
  double start_s = 0.0, end_s = 0.0;
};

/// The run of one task as its runner does it, where each job takes as long as `find_seconds` says. `memory_gb` 0: not known.
std::vector<Span> replay(const std::vector<Placed>& task, int cores, double memory_gb,
                         const std::function<double(const Placed&)>& find_seconds);

}  // namespace carillon::slurm
