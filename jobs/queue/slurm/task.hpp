// A task of a packed array: runs its jobs, as many at a time as cores and memory allow.
//
// A job is run while WORK/slurm.json names this task and is not marked as unwanted. A cancelled job is marked: the task does not start it,
// or asks its attempt to save and stop. Jobs are independent; the submitting host settles each from its folder. Before the time limit of
// the task Slurm sends SIGUSR1: running jobs save and stop, and the task is requeued with the remaining ones.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "jobs/queue/slurm/records.hpp"
#include "jobs/store/store.hpp"

namespace carillon::slurm {

/// State of a job of a task, from its folder.
enum class PackedState {
  waits,    // no attempt yet
  runs,     // an attempt without outcome: running, or killed
  stopped,  // saved and stopped; resumed when the task runs again
  ended     // has a bank, or its attempt ended otherwise
};
PackedState find_packed_state(const store::Store& store, const store::Id& id, const SubmittedJob& submitted);

struct TaskOptions {
  std::filesystem::path root;  // of the store
  std::string batch;
  int task = 0;
  std::vector<std::string> mpirun_options;
  bool has_pictures = false;
};

/// Runs until all jobs have ended or Slurm sends a signal. Takes over the signals of the process. Returns the exit code for Slurm: 0 (even
/// if jobs failed), 4 if one could not be started, 85 if jobs are left. InputError for a missing task.
int run_task(const TaskOptions& options);

}  // namespace carillon::slurm
