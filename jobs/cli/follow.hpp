// Following jobs until they have ended.
#pragma once

#include <vector>

#include "jobs/cli/shared.hpp"

namespace carillon::cli {

/// Progress bars on a terminal; else, with `lines`, one JSON object per line and change. Returns when all jobs have ended: 0 if all are
/// done, 3 if one failed or was cancelled. Empty `ids`: all jobs of the registry.
int follow(Shared& shared, const std::vector<store::Id>& ids, bool lines);

/// Runs the queue (as carillon run) until these jobs have ended; exit code as follow().
int run_until_done(Shared& shared, const std::vector<store::Id>& ids, bool has_pictures, bool is_quiet);

/// 0: all are done, 3: one failed or was cancelled, 1: some are open.
int find_exit_code(const std::vector<registry::Job>& jobs);

}  // namespace carillon::cli
