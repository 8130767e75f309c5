// A task of a packed array: starts its jobs one after the other, as many at a time as it has cores and memory for.
//
// A job is wanted while WORK/slurm.json names this task and is not marked as unwanted; who cancels it marks it, and the task does not start
// it, or asks its attempt to save and stop. What ends, in whatever way, touches no other job: the row's keeper settles each by its folder.
// Before the task's own time limit Slurm sends SIGUSR1: all that runs saves and stops, and the task is queued again with what is left.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "jobs/queue/slurm/records.hpp"
#include "jobs/store/store.hpp"

namespace carillon::slurm {

/// Where a job of a task stands, by its folder.
enum class PackedState {
  waits,    // no attempt of this submission yet
  runs,     // an attempt has begun and left no word: it runs, or was killed
  stopped,  // it was asked to save and stop; its task resumes it when it runs again
  ended     // it has its bank, or its attempt ended otherwise
};
PackedState find_packed_state(const store::Store& store, const store::Id& id, const SubmittedJob& submitted);

struct TaskOptions {
  std::filesystem::path root;  // of the store
  std::string batch;
  int task = 0;
  std::vector<std::string> mpirun_options;
  bool has_pictures = false;
};

/// Runs until all its jobs have ended or Slurm wants the node. Takes over the signals of the process: for a process of its own. Returns the
/// exit code for Slurm: 0 also when jobs failed, 4 when one could not be started, 85 when jobs are left. InputError when there is no such
/// task.
int run_task(const TaskOptions& options);

}  // namespace carillon::slurm
