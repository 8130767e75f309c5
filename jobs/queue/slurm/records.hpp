// What is known on disk of a job in Slurm's hands, so that a registry that is made again submits nothing twice.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "jobs/queue/slurm/packing.hpp"
#include "jobs/store/id.hpp"
#include "jobs/store/store.hpp"

namespace carillon::slurm {

/// WORK/slurm.json, written before sbatch is called; gone when Slurm has nothing to do with the job any more. The number of the job in
/// Slurm is in ROOT/slurm/<batch>/number, written after.
struct SubmittedJob {
  std::string batch;         // 32 hex digits
  std::string title;         // the name of the job in Slurm
  int task = -1;             // of the array; -1: no array
  std::string before = {};   // token of the attempt there was before
  int place = -1;            // in a task that it shares with others; -1: the task is its own
  bool is_unwanted = false;  // cancelled: its task is not to start it, and is to end it
};
void write_submitted_job(const std::filesystem::path& work, const SubmittedJob& submitted);
std::optional<SubmittedJob> read_submitted_job(const std::filesystem::path& work);
void remove_submitted_job(const std::filesystem::path& work);

/// WORK/retries.json: how many attempts before this one failed in a row. Written when the job is handed over, and where it ran when it is
/// queued again there.
void write_failures(const std::filesystem::path& work, int failures);
int read_failures(const std::filesystem::path& work);

/// A job of a task that it shares with others.
struct TaskJob {
  store::Id id;
  Placed placed;
  double time_limit_s = 0.0;  // of the job; 0: none
};
/// What such a task has and runs, in this order.
struct TaskList {
  int cores = 1;
  double memory_gb = 0.0;  // 0: not known
  std::vector<TaskJob> jobs;
};

/// ROOT/slurm/<batch>/<task>.jobs: none when there is none that can be read.
std::optional<TaskList> read_task(const std::filesystem::path& root, const std::string& batch, int task);
/// ROOT/slurm/<batch>/<task>.begun: the task has begun a job.
void write_begun(const std::filesystem::path& root, const std::string& batch, int task);
bool has_begun(const std::filesystem::path& root, const SubmittedJob& submitted);

/// ROOT/slurm/<batch>/: the script, the ids of its jobs, what Slurm itself said of each task, the number. Made after all
/// write_submitted_job(), and whole.
void make_batch_folder(const store::Store& store, const std::string& batch, const std::string& script, const std::vector<store::Id>& jobs,
                       const std::vector<TaskList>& tasks = {});
std::vector<store::Id> read_jobs(const std::filesystem::path& root, const std::string& batch);
void write_number(const std::filesystem::path& root, const std::string& batch, const std::string& number);
/// Empty: not known.
std::string read_number(const std::filesystem::path& root, const std::string& batch);
void remove_batch_folder(const std::filesystem::path& root, const std::string& batch);

/// The last lines of what Slurm said of a task, at most 4 KiB; empty: nothing.
std::string read_output(const std::filesystem::path& root, const SubmittedJob& submitted);

}  // namespace carillon::slurm
