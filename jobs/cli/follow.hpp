// Looking at jobs until they have ended.
#pragma once

#include <vector>

#include "jobs/cli/shared.hpp"

namespace carillon::cli {

/// Bars on a terminal, redrawn; elsewhere one JSON object a line whenever a job has changed (nothing at all when `shared.json` is set and
/// `lines` is not). Ends when all jobs have ended: 0 all are done, 3 one is failed or cancelled. Empty `ids`: all jobs of the registry.
int follow(Shared& shared, const std::vector<store::Id>& ids, bool lines);

/// Works through the queue here (as carillon run does) until these have ended; exit code as follow().
int run_until_done(Shared& shared, const std::vector<store::Id>& ids, bool has_pictures, bool is_quiet);

/// 0 when all are done, 3 when one is failed or cancelled, 1 when none is but some have not ended.
int find_exit_code(const std::vector<registry::Job>& jobs);

}  // namespace carillon::cli
