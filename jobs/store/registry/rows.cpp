#include "jobs/store/registry/rows.hpp"

#include <fmt/core.h>

#include "runtime/base/error.hpp"

namespace carillon::registry {
namespace {

constexpr int kSchemaVersion = 2;
constexpr const char* kTables =
    "create table jobs(id text primary key, seq integer, state text, name text, engine text, ranks integer, memory_gb real, time_limit_s "
    "real, reason text, token text, host text, boot text, pid integer, start_ticks integer, slurm_job text, cancel_wanted integer, "
    "attempts "
    "integer, failures integer, ready_boot_s real, ready_boot_id text, submitted_unix_s real, started_unix_s real, ended_unix_s real, "
    "given_ranks integer, given_memory_gb real) without rowid;"
    "create index open_jobs on jobs(seq) where state in ('queued', 'waiting', 'running');"
    "create table submissions(job_file text primary key, seq integer, id text, request text) without rowid";

Job read_row(const Statement& row) {
  const auto id = store::parse_id(row.text(0));
  const auto state = store::find_state(row.text(2));
  const auto engine = store::find_engine(row.text(4));
  if (!id || !state || !engine) throw Damaged("a row of the registry has no valid id, state or engine");
  Job job{*id};
  job.state = *state;
  job.name = row.text(3);
  job.engine = *engine;
  job.resources = {static_cast<int>(row.integer(5)), row.number(6), row.number(7)};
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
  return job;
}

void write_row(Database& database, const Job& job, long long seq) {
  Statement row(database, "replace into jobs values(?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  row.bind(job.id.text()).bind(seq).bind(to_text(job.state)).bind(job.name).bind(to_text(job.engine));
  row.bind(job.resources.ranks).bind(job.resources.memory_gb).bind(job.resources.time_limit_s).bind(job.reason).bind(job.token);
  row.bind(job.worker.host).bind(job.worker.boot).bind(job.worker.pid).bind(job.worker.start_ticks).bind(job.slurm_job);
  row.bind(job.cancel_wanted).bind(job.attempts).bind(job.failures).bind(job.ready_boot_s).bind(job.ready_boot_id);
  row.bind(job.submitted_unix_s).bind(job.started_unix_s).bind(job.ended_unix_s).bind(job.given.ranks).bind(job.given.memory_gb);
  row.step();
}

std::optional<long long> find_seq(Database& database, const store::Id& id) {
  Statement row(database, "select seq from jobs where id = ?");
  return row.bind(id.text()).step() ? std::optional(row.integer(0)) : std::nullopt;
}

}  // namespace

bool make_tables(Database& database) {
  Statement version(database, "select user_version, (select count(*) from sqlite_schema) from pragma_user_version");
  version.step();
  if (version.integer(0) == kSchemaVersion) return false;
  if (version.integer(1) > 0) throw Damaged("the registry is of another version");
  database.run(kTables);
  database.run(fmt::format("pragma user_version = {}", kSchemaVersion).c_str());
  return true;
}

std::vector<Job> read_jobs(Database& database, const std::string& condition, const std::vector<std::string>& bind) {
  std::vector<Job> jobs;
  Statement row(database, fmt::format("select * from jobs {} order by seq", condition).c_str());
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
  if (find_seq(database, job.id)) return false;
  write_row(database, job, seq);
  return true;
}

void update_job(Database& database, const Job& job) {
  if (const auto seq = find_seq(database, job.id)) write_row(database, job, *seq);
}

std::vector<Submission> read_submissions(Database& database, const std::string& job_file) {
  std::vector<Submission> submissions;
  Statement row(
      database,
      fmt::format("select job_file, request from submissions {} order by seq", job_file.empty() ? "" : "where job_file = ?").c_str());
  if (!job_file.empty()) row.bind(job_file);
  try {
    while (row.step()) submissions.push_back({row.text(0), store::parse_request(row.text(1), "registry")});
  } catch (const InputError& error) {
    throw Damaged(error.what());
  }
  return submissions;
}

void write_submission(Database& database, const Submission& submission, long long seq) {
  Statement row(database, "replace into submissions values(?, ?, ?, ?)");
  row.bind(submission.job_file).bind(seq).bind(submission.request.id).bind(store::format_request(submission.request, true)).step();
}

}  // namespace carillon::registry
