// The script of a batch, and the words that sbatch is given with it. Pure functions: whatever is in a path, it stays a path.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "jobs/queue/slurm/settings.hpp"

namespace carillon::slurm {

/// deploy/slurm/job.sh and deploy/slurm/task.sh.
extern const char* const kJobScript;
extern const char* const kTaskScript;

/// Jobs that ask for the same: one of them is a job of Slurm, more are an array. Or tasks of a packed array, each for many jobs.
struct Batch {
  std::string name;                  // 32 hex digits
  std::string title;                 // for squeue: "carillon-<12 digits>", of the id of the only job, else of `name`
  std::string comment;               // the id of the only job, else how many there are; `name` follows in Slurm
  std::filesystem::path root;        // of the store, absolute
  std::vector<std::string> folders;  // below root/work: "ab/abcdef..."; none: a packed array
  std::size_t tasks = 0;             // of a packed array
  std::filesystem::path program;     // carillon
  int ranks = 1;                     // of a packed array, the cores of a task
  double memory_gb = 0.0;            // of all ranks together; 0: what the site gives
  double time_limit_s = 0.0;         // 0: what the site gives
};

/// A word that a shell reads as just these bytes. Throws InputError for line ends and zero bytes, which belong to no path of ours.
std::string quote_word(std::string_view word);

std::string make_script(const Batch& batch, const Settings& settings);

/// sbatch and its options; the script is its input. Throws InputError for a store whose path Slurm would read otherwise (a backslash).
std::vector<std::string> make_sbatch(const Batch& batch, const Settings& settings);

/// Where Slurm puts what itself says of task `task` (of a single job, 0).
std::filesystem::path make_output_file(const std::filesystem::path& root, const std::string& batch, int task);

}  // namespace carillon::slurm
