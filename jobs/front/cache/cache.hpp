// Banks that are computed when they are missing: for bodies that a scene describes instead of naming a bank.
//
// A bank is kept under the hash of its job, the bytes of its files and the solver's version, in a store of its own (jobs/store) without a
// queue: a bank in it is not computed again. The cache may be removed at any time.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "precompute/job/job_spec.hpp"

namespace carillon::cache {

struct Made {
  std::filesystem::path bank;         // read-only
  bool is_new = false;                // solved now
  std::vector<std::string> warnings;  // of the job and its mesh
};

/// $XDG_CACHE_HOME/carillon, else ~/.cache/carillon. SystemError where there is no home.
std::filesystem::path find_default_cache();

/// The bank of a job without "bank": from the user's own store if `carillon submit` has computed it, from the cache, or solved here and
/// kept there. A body without a mesh size or an accuracy is a preview (job/preview.hpp). `solver`: the line that
/// carillon-precompute --version prints. Progress goes to standard error, unless `is_quiet`.
/// Throws InputError, which names the place in the job's file, SolveError and SystemError; nothing is left behind then.
Made find_or_make(const job::JobSpec& job, const std::string& solver, const std::filesystem::path& cache, bool is_quiet);

}  // namespace carillon::cache
