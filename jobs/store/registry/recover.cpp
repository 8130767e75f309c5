// Method:     A job in banks/ is done; the state of a job in work/ is in its state.json; order and names come from the log of submissions.
#include "jobs/store/registry/recover.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <iterator>
#include <map>
#include <set>

#include "jobs/store/files.hpp"
#include "jobs/store/outcome/outcome.hpp"
#include "jobs/store/registry/rows.hpp"
#include "runtime/base/descriptor.hpp"
#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"

namespace carillon::registry {
namespace {

namespace fs = std::filesystem;

constexpr const char* kLogName = "submissions.jsonl";
constexpr std::size_t kMaxLineBytes = 32 << 20;

/// A job with a live attempt is running. Attempts on other hosts count as live for jobs of Slurm until they have left an outcome.
bool adopt_attempt(Job& job, const fs::path& work) {
  const auto attempt = outcome::read_attempt(work);
  if (!attempt) return false;
  const process::Life life = process::find_life(attempt->process);
  const auto ended = outcome::read_outcome(work);
  const bool is_over = ended && ended->token == attempt->token;
  if (life == process::Life::gone || (life == process::Life::elsewhere && (job.engine != store::JobEngine::slurm || is_over))) return false;
  job.state = JobState::running;
  job.token = attempt->token;
  job.worker = attempt->process;
  return true;
}

std::string describe_fault(const std::string& fault) { return fault + "; carillon retry, or submit, computes it again"; }

/// The row of a job from its folder. The content of damaged records is lost, the job is not.
Job make_job(const store::Store& store, const store::Id& id) {
  Job job{id};
  const fs::path folder = store.find_folder(id);
  try {
    if (const auto request = store::read_request(folder)) {
      job.name = find_name(request->job_file);
      job.engine = request->engine;
      job.resources = request->resources;
      job.submitted_unix_s = request->submitted_unix_s;
    }
  } catch (const InputError&) {
    job.name = "?";
  }
  const std::optional<std::string> fault = store.find_bank_fault(id, store::Look::quick);
  if (!fault) {
    job.state = JobState::done;
    return job;
  }
  if (!store.has_work(id)) {
    job.state = JobState::failed;
    job.reason = describe_fault(*fault);
    return job;
  }
  try {
    if (const auto saved = store::read_state(folder)) {
      job.state = saved->state == JobState::waiting ? JobState::queued : saved->state;
      job.reason = saved->reason;
      job.attempts = saved->attempts;
      job.failures = saved->failures;
    }
  } catch (const InputError&) {
  }
  adopt_attempt(job, folder);
  return job;
}

/// Differences of rows and folders.
struct Differences {
  std::vector<store::Id> unknown;            // folder without row
  std::vector<store::Id> finished, missing;  // rows with a bank; rows without any folder
  std::vector<store::Id> alive;              // queued rows with a live attempt
  bool is_empty() const { return unknown.empty() && finished.empty() && missing.empty() && alive.empty(); }
};

Differences find_differences(Database& database, const store::Store& store) {
  std::map<store::Id, JobState> rows;
  Statement row(database, "select id, state from jobs");
  while (row.step()) {
    const auto id = store::parse_id(row.text(0));
    const auto state = store::find_state(row.text(1));
    if (!id || !state) throw Damaged("a row of the registry has no valid id or state");
    rows.emplace(*id, *state);
  }
  const std::vector<store::Id> work = store.list_work(), banks = store.list_banks();  // in this order: a job moves from work to banks
  Differences found;
  for (const auto* list : {&banks, &work}) {
    for (const store::Id& id : *list) {
      if (rows.count(id) == 0) found.unknown.push_back(id);
    }
  }
  std::vector<store::Id> whole;
  std::copy_if(banks.begin(), banks.end(), std::back_inserter(whole), [&](const store::Id& id) { return store.has_bank(id); });
  for (const store::Id& id : whole) {
    const auto at = rows.find(id);
    if (at != rows.end() && at->second != JobState::done && at->second != JobState::running) found.finished.push_back(id);
  }
  for (const auto& [id, state] : rows) {
    Job probe{id};
    if ((state == JobState::queued || state == JobState::waiting) && adopt_attempt(probe, store.work_folder(id))) found.alive.push_back(id);
    if (state == JobState::running || state == JobState::failed || std::binary_search(whole.begin(), whole.end(), id)) continue;
    if (state == JobState::done || !std::binary_search(work.begin(), work.end(), id)) found.missing.push_back(id);
  }
  return found;
}

/// False if the row needs no change any more.
bool settle_missing(Job& job, const store::Store& store) {
  const std::optional<std::string> fault = store.find_bank_fault(job.id, store::Look::quick);
  if (!fault || job.state == JobState::running || job.state == JobState::failed) return false;
  if (store.has_work(job.id)) {
    if (job.state != JobState::done) return false;
    job.state = JobState::queued;
    return true;
  }
  job.reason = store.has_bank_folder(job.id) ? describe_fault(*fault)
               : job.state == JobState::done ? "its bank is no longer in the store; submit the job again"
                                             : "its folder is no longer in the store; submit the job again";
  job.state = JobState::failed;
  return true;
}

}  // namespace

std::string find_name(const std::string& job_file) {
  const std::size_t slash = job_file.rfind('/');
  return slash == std::string::npos ? job_file : job_file.substr(slash + 1);
}

void append_submissions(const store::Store& store, const std::vector<Submission>& submissions) {
  const fs::path file = store.root() / kLogName;
  std::string text;
  for (const Submission& submission : submissions) {
    store::Request request = submission.request;
    request.job_file = submission.job_file;
    text += store::format_request(request, true);
  }
  const base::Descriptor log(::open(file.c_str(), O_RDWR | O_CREAT | O_APPEND | O_CLOEXEC, 0666));
  if (log.get() < 0) store::throw_errno(file, "write", errno);
  char last = '\n';
  if (const off_t size = ::lseek(log.get(), 0, SEEK_END); size > 0) (void)!::pread(log.get(), &last, 1, size - 1);
  if (last != '\n') text.insert(0, "\n");  // after a truncated line
  int error = base::write_all(log.get(), text);
  if (error == 0 && ::fsync(log.get()) != 0) error = errno;
  if (error != 0) store::throw_errno(file, "write", error);
}

std::vector<Submission> read_submission_log(const store::Store& store) {
  std::vector<Submission> submissions;
  std::map<std::string, std::size_t> newest;
  std::ifstream stream(store.root() / kLogName, std::ios::binary);
  for (std::string line; std::getline(stream, line);) {
    if (line.empty() || line.size() > kMaxLineBytes) continue;
    try {
      const store::Request request = store::parse_request(line, kLogName);
      newest[request.job_file] = submissions.size();
      submissions.push_back({request.job_file, request});
    } catch (const InputError&) {
    }
  }
  std::vector<Submission> kept;
  for (std::size_t i = 0; i < submissions.size(); ++i) {
    if (newest[submissions[i].job_file] == i) kept.push_back(submissions[i]);
  }
  return kept;
}

void rewrite_submission_log(const store::Store& store, const std::vector<Submission>& submissions) {
  std::string text;
  for (const Submission& submission : submissions) text += store::format_request(submission.request, true);
  base::write_file(store.root() / kLogName, text);
}

std::size_t fill_from_store(Database& database, const store::Store& store) {
  std::set<store::Id> left;
  for (const store::Id& id : store.list_work()) left.insert(id);
  for (const store::Id& id : store.list_banks()) left.insert(id);
  const std::size_t count = left.size();
  long long seq = 1;
  for (const Submission& submission : read_submission_log(store)) {
    write_submission(database, submission, seq);
    const store::Id id = store::require_id(submission.request.id, kLogName);
    if (left.erase(id) > 0) insert_job(database, make_job(store, id), seq);
    ++seq;
  }
  std::vector<Job> others;
  for (const store::Id& id : left) others.push_back(make_job(store, id));
  std::stable_sort(others.begin(), others.end(), [](const Job& a, const Job& b) { return a.submitted_unix_s < b.submitted_unix_s; });
  for (const Job& job : others) insert_job(database, job, seq++);
  return count;
}

void reconcile(Database& database, const store::Store& store, const Say& say) {
  if (find_differences(database, store).is_empty()) return;
  Transaction transaction(database);
  const Differences found = find_differences(database, store);
  long long seq = find_next_seq(database);
  for (const store::Id& id : found.unknown) insert_job(database, make_job(store, id), seq++);
  for (const store::Id& id : found.finished) {
    Job job = *read_job(database, id);
    job.state = JobState::done;
    job.reason.clear();
    update_job(database, job);
  }
  for (const store::Id& id : found.alive) {
    Job job = *read_job(database, id);
    if (adopt_attempt(job, store.work_folder(id))) update_job(database, job);
  }
  std::size_t missing = 0;
  for (const store::Id& id : found.missing) {
    Job job = *read_job(database, id);
    if (!settle_missing(job, store)) continue;
    update_job(database, job);
    ++missing;
  }
  transaction.commit();
  if (missing > 0)
    say(fmt::format("{} job{} of the registry had lost their folders, or have damaged banks; carillon status lists them", missing,
                    missing == 1 ? "" : "s"));
}

}  // namespace carillon::registry
