// Script of a batch, and arguments of sbatch. Pure functions, safe for any path.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "jobs/queue/slurm_settings.hpp"

namespace carillon::slurm {

/// deploy/slurm/job.sh and deploy/slurm/task.sh.
extern const char* const kJobScript;
extern const char* const kTaskScript;

/// Jobs with equal resources: one job or an array. Or a packed array, whose tasks run many jobs each.
struct Batch {
  std::string name;                  // 32 hex digits
  std::string title;                 // job name in Slurm: "carillon-<12 digits>" of the id of the only job, else of `name`
  std::string comment;               // id of the only job, else the number of jobs; `name` is appended
  std::filesystem::path root;        // of the store, absolute
  std::vector<std::string> folders;  // below root/work: "ab/abcdef..."; empty: a packed array
  std::size_t tasks = 0;             // of a packed array
  std::filesystem::path program;     // carillon
  int ranks = 1;                     // of a packed array: cores of a task
  double memory_gb = 0.0;            // all ranks together; 0: default of the site
  double time_limit_s = 0.0;         // 0: default of the site
};

/// Quotes a word for a shell. InputError for newlines and zero bytes.
std::string quote_word(std::string_view word);

std::string make_script(const Batch& batch, const queue::SlurmSettings& settings);

/// sbatch with options; its input is the script. InputError for a store path with a backslash.
std::vector<std::string> make_sbatch(const Batch& batch, const queue::SlurmSettings& settings);

/// File with Slurm's output of a task (of a single job: 0).
std::filesystem::path make_output_file(const std::filesystem::path& root, const std::string& batch, int task);

}  // namespace carillon::slurm
