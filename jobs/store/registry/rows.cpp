#include "jobs/store/registry/rows.hpp"

#include <fmt/core.h>

#include <array>

#include "runtime/base/error.hpp"

namespace carillon::registry {
namespace {

constexpr const char* kJobsTable =
    "CREATE TABLE jobs(id TEXT PRIMARY KEY, seq INTEGER NOT NULL, state TEXT NOT NULL, name TEXT NOT NULL, engine TEXT NOT NULL, ranks "
    "INTEGER NOT NULL, "
    "memory_gb REAL NOT NULL, time_limit_s REAL NOT NULL, reason TEXT NOT NULL, token TEXT NOT NULL, host TEXT NOT NULL, boot TEXT NOT "
    "NULL, pid INTEGER NOT NULL, "
    "start_ticks INTEGER NOT NULL, slurm_job TEXT NOT NULL, cancel_wanted INTEGER NOT NULL, attempts INTEGER NOT NULL, failures INTEGER "
    "NOT NULL, "
    "ready_boot_s REAL NOT NULL, ready_boot_id TEXT NOT NULL, submitted_unix_s REAL NOT NULL, started_unix_s REAL NOT NULL, ended_unix_s "
    "REAL NOT NULL, "
    "given_ranks INTEGER NOT NULL, given_memory_gb REAL NOT NULL, "
    "sum TEXT NOT NULL) WITHOUT ROWID";
constexpr const char* kOpenIndex = "CREATE INDEX open_jobs ON jobs(seq) WHERE state IN ('queued', 'waiting', 'running')";
constexpr const char* kSubmissionsTable =
    "CREATE TABLE submissions(job_file TEXT PRIMARY KEY, seq INTEGER NOT NULL, id TEXT NOT NULL, request TEXT NOT NULL, sum TEXT NOT NULL) "
    "WITHOUT ROWID";
constexpr const char* kVersionTable = "CREATE TABLE version(number INTEGER NOT NULL, sum TEXT NOT NULL)";
constexpr std::array<const char*, 4> kSchema{kJobsTable, kOpenIndex, kSubmissionsTable, kVersionTable};

constexpr const char* kColumns =
    "id, seq, state, name, engine, ranks, memory_gb, time_limit_s, reason, token, host, boot, pid, start_ticks, slurm_job, cancel_wanted, "
    "attempts, failures, "
    "ready_boot_s, ready_boot_id, submitted_unix_s, started_unix_s, ended_unix_s, given_ranks, given_memory_gb, sum";
constexpr int kSumColumn = 25;

std::string calc_sum(const std::string& fields) { return store::hash_text(fields).text().substr(0, 16); }

std::string calc_sum(const Job& job, long long seq) {
  std::string fields = fmt::format("{}|{}|{}|{}|{}|{}|{}|{}", job.id.text(), seq, to_text(job.state), to_text(job.engine),
                                   job.resources.ranks, job.resources.memory_gb, job.resources.time_limit_s, job.cancel_wanted);
  fields += fmt::format("|{}|{}|{}|{}|{}|{}|{}", job.worker.pid, job.worker.start_ticks, job.attempts, job.failures, job.ready_boot_s,
                        job.submitted_unix_s, job.started_unix_s);
  fields += fmt::format("|{}|{}|{}", job.ended_unix_s, job.given.ranks, job.given.memory_gb);
  for (const std::string* text :
       {&job.name, &job.reason, &job.token, &job.worker.host, &job.worker.boot, &job.slurm_job, &job.ready_boot_id})
    fields += fmt::format("|{}:{}", text->size(), *text);
  return calc_sum(fields);
}

std::string calc_submission_sum(const std::string& job_file, long long seq, const std::string& id, const std::string& request) {
  return calc_sum(fmt::format("{}|{}:{}|{}|{}", seq, job_file.size(), job_file, id, request));
}

std::string calc_version_sum(long long version) { return calc_sum(fmt::format("carillon registry {}", version)); }

Job read_row(const Statement& row) {
  const auto id = store::parse_id(row.text(0));
  const auto state = store::find_state(row.text(2));
  const auto engine = store::find_engine(row.text(4));
  if (!id || !state || !engine) throw Damaged("a row of the registry names no job or no state");
  Job job{*id};
  job.state = *state;
  job.name = row.text(3);
  job.engine = *engine;
  job.resources.ranks = static_cast<int>(row.integer(5));
  job.resources.memory_gb = row.number(6);
  job.resources.time_limit_s = row.number(7);
  job.reason = row.text(8);
  job.token = row.text(9);
  job.worker = {row.text(10), row.text(11), static_cast<int>(row.integer(12)), static_cast<std::uint64_t>(row.integer(13))};
  job.slurm_job = row.text(14);
  job.cancel_wanted = row.integer(15) != 0;
  job.attempts = static_cast<int>(row.integer(16));
  job.failures = static_cast<int>(row.integer(17));
  job.ready_boot_s = row.number(18);
  job.ready_boot_id = row.text(19);
  job.submitted_unix_s = row.number(20);
  job.started_unix_s = row.number(21);
  job.ended_unix_s = row.number(22);
  job.given.ranks = static_cast<int>(row.integer(23));
  job.given.memory_gb = row.number(24);
  if (row.text(kSumColumn) != calc_sum(job, row.integer(1))) throw Damaged("a row of the registry is not as it was written");
  return job;
}

void bind_row(Statement& row, const Job& job, long long seq) {
  row.bind(job.id.text()).bind(seq).bind(to_text(job.state)).bind(job.name).bind(to_text(job.engine));
  row.bind(static_cast<long long>(job.resources.ranks)).bind(job.resources.memory_gb).bind(job.resources.time_limit_s);
  row.bind(job.reason).bind(job.token).bind(job.worker.host).bind(job.worker.boot).bind(static_cast<long long>(job.worker.pid));
  row.bind(static_cast<long long>(job.worker.start_ticks)).bind(job.slurm_job).bind(job.cancel_wanted ? 1LL : 0LL);
  row.bind(static_cast<long long>(job.attempts)).bind(static_cast<long long>(job.failures)).bind(job.ready_boot_s).bind(job.ready_boot_id);
  row.bind(job.submitted_unix_s).bind(job.started_unix_s).bind(job.ended_unix_s);
  row.bind(static_cast<long long>(job.given.ranks)).bind(job.given.memory_gb).bind(calc_sum(job, seq));
  row.step();
}

std::string make_sql(const char* verb, int marks) {
  std::string sql = std::string(verb) + " values(";
  for (int i = 0; i < marks; ++i) sql += i == 0 ? "?" : ", ?";
  return sql + ")";
}

/// job_file, seq, id, request, sum.
void check_submission_row(const Statement& row) {
  if (row.text(4) != calc_submission_sum(row.text(0), row.integer(1), row.text(2), row.text(3)))
    throw Damaged("a submission in the registry is not as it was written");
}

void check_submissions(Database& database) {
  Statement row(database, "select job_file, seq, id, request, sum from submissions");
  while (row.step()) check_submission_row(row);
}

Submission read_submission_row(const Statement& row) {
  check_submission_row(row);
  return {row.text(0), store::parse_request(row.text(3), "registry")};
}

}  // namespace

bool make_tables(Database& database) {
  Statement count(database, "select count(*) from sqlite_schema");
  count.step();
  if (count.integer(0) > 0) return false;
  for (const char* sql : kSchema) database.run(sql);
  Statement version(database, "insert into version values(?, ?)");
  version.bind(static_cast<long long>(kSchemaVersion)).bind(calc_version_sum(kSchemaVersion)).step();
  return true;
}

void check_tables(Database& database) {
  Statement whole(database, "pragma integrity_check(1)");
  if (!whole.step() || whole.text(0) != "ok") throw Damaged("SQLite finds the registry damaged: " + whole.text(0));
  Statement version(database, "select number, sum from version");
  if (!version.step() || version.text(1) != calc_version_sum(version.integer(0))) throw Damaged("the version of the registry is damaged");
  if (version.integer(0) != kSchemaVersion)
    throw InputError(
        fmt::format("the registry of this store has version {}, and this program knows {}; use the newer Carillon, or another store",
                    version.integer(0), kSchemaVersion));
  std::size_t known = 0;
  Statement tables(database, "select sql from sqlite_schema where sql is not null");
  while (tables.step()) {
    for (const char* sql : kSchema) known += tables.text(0) == sql ? 1 : 0;
  }
  if (known != kSchema.size()) throw Damaged("the tables of the registry are damaged");
  read_jobs(database);
  check_submissions(database);
}

std::vector<Job> read_jobs(Database& database, const std::string& condition, const std::vector<std::string>& bind) {
  std::vector<Job> jobs;
  Statement row(database, fmt::format("select {} from jobs {} order by seq", kColumns, condition).c_str());
  for (const std::string& text : bind) row.bind(text);
  while (row.step()) jobs.push_back(read_row(row));
  return jobs;
}

std::optional<Job> read_job(Database& database, const store::Id& id) {
  std::vector<Job> jobs = read_jobs(database, "where id = ?", {id.text()});
  return jobs.empty() ? std::nullopt : std::optional(jobs.front());
}

long long find_next_seq(Database& database) {
  Statement row(database, "select max((select coalesce(max(seq), 0) from jobs), (select coalesce(max(seq), 0) from submissions)) + 1");
  row.step();
  return row.integer(0);
}

bool insert_job(Database& database, const Job& job, long long seq) {
  Statement known(database, "select 1 from jobs where id = ?");
  if (known.bind(job.id.text()).step()) return false;
  Statement row(database, make_sql("insert into jobs", kSumColumn + 1).c_str());
  bind_row(row, job, seq);
  return true;
}

void update_job(Database& database, const Job& job) {
  Statement old(database, "select seq from jobs where id = ?");
  if (!old.bind(job.id.text()).step()) return;
  const long long seq = old.integer(0);
  Statement row(database, make_sql("replace into jobs", kSumColumn + 1).c_str());
  bind_row(row, job, seq);
}

std::vector<Submission> read_submissions(Database& database, const std::string& job_file) {
  std::vector<Submission> submissions;
  const std::string condition = job_file.empty() ? "" : "where job_file = ?";
  Statement row(database, ("select job_file, seq, id, request, sum from submissions " + condition + " order by seq").c_str());
  if (!job_file.empty()) row.bind(job_file);
  while (row.step()) submissions.push_back(read_submission_row(row));
  return submissions;
}

void write_submission(Database& database, const Submission& submission, long long seq) {
  const std::string request = store::format_request(submission.request, true);
  Statement row(database, "replace into submissions values(?, ?, ?, ?, ?)");
  row.bind(submission.job_file)
      .bind(seq)
      .bind(submission.request.id)
      .bind(request)
      .bind(calc_submission_sum(submission.job_file, seq, submission.request.id, request))
      .step();
}

}  // namespace carillon::registry
