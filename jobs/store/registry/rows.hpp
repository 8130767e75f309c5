// Tables of the registry, and the conversion of Job and Submission to rows.
#pragma once

#include <string>
#include <vector>

#include "jobs/store/registry/database.hpp"
#include "jobs/store/registry/registry.hpp"

namespace carillon::registry {

/// Creates the tables in an empty database. False: they exist. Damaged: tables of another version. In a transaction.
bool make_tables(Database& database);

/// Rows in the order of submission; `condition`: "where ..." with its parameters in `bind`.
std::vector<Job> read_jobs(Database& database, const std::string& condition = "", const std::vector<std::string>& bind = {});
std::optional<Job> read_job(Database& database, const store::Id& id);
/// The number of the next submission.
long long find_next_seq(Database& database);
/// In a transaction. False: there is a row of this id already.
bool insert_job(Database& database, const Job& job, long long seq);
void update_job(Database& database, const Job& job);

std::vector<Submission> read_submissions(Database& database, const std::string& job_file = "");
/// In a transaction; replaces an older one of the same job file.
void write_submission(Database& database, const Submission& submission, long long seq);

}  // namespace carillon::registry
