// The registry from the store, and the log of submissions that it is built from.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "jobs/store/registry/database.hpp"
#include "jobs/store/registry/registry.hpp"

namespace carillon::registry {

using Say = std::function<void(const std::string&)>;

/// Appends to STORE/submissions.jsonl, one line each, and syncs. SystemError when the disk refuses.
void append_submissions(const store::Store& store, const std::vector<Submission>& submissions);
/// The newest line of each job file, in the order of the file. Damaged lines are skipped.
std::vector<Submission> read_submission_log(const store::Store& store);
/// Replaces the log. The caller holds store::Store::lock_exclusive().
void rewrite_submission_log(const store::Store& store, const std::vector<Submission>& submissions);

/// Fills new tables from the store. In a transaction. Returns the number of jobs.
std::size_t fill_from_store(Database& database, const store::Store& store);

/// Updates rows from the folders of the store, except running ones.
void reconcile(Database& database, const store::Store& store, const Say& say);

}  // namespace carillon::registry
