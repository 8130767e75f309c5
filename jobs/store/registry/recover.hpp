// The registry from the store, and the log of submissions that it is made from.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "jobs/store/registry/database.hpp"
#include "jobs/store/registry/registry.hpp"

namespace carillon::registry {

using Say = std::function<void(const std::string&)>;

/// Renames a damaged registry with its log, so that nothing is in the way of a new one; returns the new name.
std::filesystem::path set_aside(const std::filesystem::path& file);

/// Appends to STORE/submissions.jsonl, one line each, and syncs it. SystemError when the disk refuses.
void append_submissions(const store::Store& store, const std::vector<Submission>& submissions);
/// The newest line of each job file, in the order of the file; what is no line of ours is passed over.
std::vector<Submission> read_submission_log(const store::Store& store);
/// Replaces the log by only those. No process may append meanwhile (store::Store::lock_exclusive).
void rewrite_submission_log(const store::Store& store, const std::vector<Submission>& submissions);

/// Fills new tables with all that the store knows. In a transaction. Returns the number of jobs.
std::size_t fill_from_store(Database& database, const store::Store& store);

/// Brings rows up to date with the folders of the store; running ones are left to those who run them.
void reconcile(Database& database, const store::Store& store, const Say& say);

}  // namespace carillon::registry
