// Banks that are made when they are missing: of bodies that a scene describes in place of naming a bank.
//
// A bank is kept under the hash of its job, the bytes of its files and the solver's version, in a store of its own (jobs/store) without a
// queue: what is there is not solved again. The cache may be removed at any time.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "precompute/job/job_spec.hpp"

namespace carillon::cache {

struct Made {
  std::filesystem::path bank;         // read-only
  bool is_new = false;                // solved now
  std::vector<std::string> warnings;  // of the job
};

/// $XDG_CACHE_HOME/carillon, else ~/.cache/carillon. SystemError where there is no home.
std::filesystem::path find_default_cache();

/// The bank of a job without "bank": from the user's own store where `carillon submit` has left it, from the cache, or solved here and
/// kept there. A body that says neither how fine nor how accurate is a preview (job/preview.hpp). `solver`: the line that
/// carillon-precompute --version prints. Progress goes to standard error, unless `is_quiet`.
/// Throws InputError, which names the place in the job's file, SolveError and SystemError; nothing is left behind then.
Made find_or_make(const job::JobSpec& job, const std::string& solver, const std::filesystem::path& cache, bool is_quiet);

}  // namespace carillon::cache
