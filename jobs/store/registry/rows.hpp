// The tables, and how a Job and a Submission become rows. Every row carries a hash of itself: SQLite sees damage of its structure, this
// sees damage of what is in it.
#pragma once

#include <string>
#include <vector>

#include "jobs/store/registry/database.hpp"
#include "jobs/store/registry/registry.hpp"

namespace carillon::registry {

inline constexpr int kSchemaVersion = 1;

/// Makes the tables in an empty database, or nothing when they are there. False: they were there. In a transaction.
bool make_tables(Database& database);

/// Looks at every page and every row. Throws Damaged for what is not as we wrote it, InputError for a newer version.
void check_tables(Database& database);

/// All rows in the order of submission, or those that `condition` ("where ...", without the word order) picks; `bind` fills its marks.
std::vector<Job> read_jobs(Database& database, const std::string& condition = "", const std::vector<std::string>& bind = {});
std::optional<Job> read_job(Database& database, const store::Id& id);
/// The number of the next submission.
long long find_next_seq(Database& database);
/// In a transaction. False: there is a row of this id already.
bool insert_job(Database& database, const Job& job, long long seq);
void update_job(Database& database, const Job& job);

std::vector<Submission> read_submissions(Database& database, const std::string& job_file = "");
/// In a transaction; takes the place of an older one of the same job file.
void write_submission(Database& database, const Submission& submission, long long seq);

}  // namespace carillon::registry
