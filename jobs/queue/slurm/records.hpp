// Files about submitted jobs and batches, so that nothing is submitted twice after a rebuild of the registry.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "jobs/queue/slurm/packing.hpp"
#include "jobs/store/id.hpp"
#include "jobs/store/store.hpp"

namespace carillon::slurm {

/// WORK/slurm.json, written before sbatch is called, removed when the job has ended in Slurm. Its number is in ROOT/slurm/<batch>/number,
/// written after sbatch.
struct SubmittedJob {
  std::string batch;         // 32 hex digits
  std::string title;         // job name in Slurm
  int task = -1;             // index in the array; -1: no array
  std::string before = {};   // token of the previous attempt
  int place = -1;            // index in a shared task; -1: own task
  bool is_unwanted = false;  // cancelled: the task must not start it, or must stop it
};
void write_submitted_job(const std::filesystem::path& work, const SubmittedJob& submitted);
std::optional<SubmittedJob> read_submitted_job(const std::filesystem::path& work);
void remove_submitted_job(const std::filesystem::path& work);

/// WORK/retries.json: consecutive failed attempts. Written at submission, and on the node at a requeue.
void write_failures(const std::filesystem::path& work, int failures);
int read_failures(const std::filesystem::path& work);

/// A job of a shared task.
struct TaskJob {
  store::Id id;
  Placed placed;
  double time_limit_s = 0.0;  // of the job; 0: none
};
/// A shared task: resources, and jobs in start order.
struct TaskList {
  int cores = 1;
  double memory_gb = 0.0;  // 0: unknown
  std::vector<TaskJob> jobs;
};

/// ROOT/slurm/<batch>/<task>.jobs; none if missing or damaged.
std::optional<TaskList> read_task(const std::filesystem::path& root, const std::string& batch, int task);
/// ROOT/slurm/<batch>/<task>.begun: the task has started a job.
void write_begun(const std::filesystem::path& root, const std::string& batch, int task);
bool has_begun(const std::filesystem::path& root, const SubmittedJob& submitted);

/// ROOT/slurm/<batch>/: script, ids of jobs, output of Slurm per task, number. Created atomically, after all write_submitted_job().
void make_batch_folder(const store::Store& store, const std::string& batch, const std::string& script, const std::vector<store::Id>& jobs,
                       const std::vector<TaskList>& tasks = {});
std::vector<store::Id> read_jobs(const std::filesystem::path& root, const std::string& batch);
void write_number(const std::filesystem::path& root, const std::string& batch, const std::string& number);
/// Empty: unknown.
std::string read_number(const std::filesystem::path& root, const std::string& batch);
void remove_batch_folder(const std::filesystem::path& root, const std::string& batch);

/// The last 4 KiB of Slurm's output of a task.
std::string read_output(const std::filesystem::path& root, const SubmittedJob& submitted);

}  // namespace carillon::slurm
