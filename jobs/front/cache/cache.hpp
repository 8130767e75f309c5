// Cache of banks for bodies that a scene describes instead of naming a bank.
//
// A store of its own (jobs/store) without a queue: banks under the hash of job, input files and solver version. May be removed at any time.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "precompute/job/job_spec.hpp"

namespace carillon::cache {

struct Made {
  std::filesystem::path bank;         // read-only
  bool is_new = false;                // computed by this call
  std::vector<std::string> warnings;  // of the job and its mesh
};

/// $XDG_CACHE_HOME/carillon, else ~/.cache/carillon. SystemError without HOME.
std::filesystem::path find_default_cache();

/// The bank of a job without "bank": from the user's store, from the cache, or computed now and cached. A body without mesh size and
/// accuracy is a preview (job/preview.hpp). `solver`: output of carillon-precompute --version. Progress goes to standard error unless
/// `is_quiet`. InputError with the place in the job's file, SolveError, SystemError; no files are left behind then.
Made find_or_make(const job::JobSpec& job, const std::string& solver, const std::filesystem::path& cache, bool is_quiet);

}  // namespace carillon::cache
