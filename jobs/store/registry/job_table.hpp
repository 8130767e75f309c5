// A job as a row, and the table of rows as the queue uses it.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "jobs/store/process/process.hpp"
#include "jobs/store/id.hpp"
#include "jobs/store/records.hpp"

namespace carillon::registry {

using store::JobState;
using store::to_text;

/// The wall clock, seconds since 1970: for people, never for decisions.
double find_unix_seconds();
/// The last part of a job file's name.
std::string find_name(const std::string& job_file);

struct Job {
  store::Id id;
  /// running: `worker` is the process of the attempt, before it is known the one that claimed. waiting: not before `ready_boot_s` of boot
  /// `ready_boot_id` (another boot: at once).
  JobState state = JobState::queued;
  std::string name = {};  // of the job file that asked last, for people
  store::JobEngine engine = store::JobEngine::local;
  store::Resources resources = {};  // as asked for
  store::Resources given = {};      // ranks and memory of the last attempt, as the queue chose them
  std::string reason = {};          // one sentence: why it failed, waits, or was cancelled
  std::string token = {};           // of the attempt, 32 hex digits; empty before the first
  process::Identity worker = {};    // of the attempt; of the one who claimed, before that is known
  std::string slurm_job = {};       // "123", "123_4", or "123_4.7": one of several jobs of that task
  bool cancel_wanted = false;       // a running job is to end
  int attempts = 0;
  int failures = 0;  // attempts that count against the retries
  double ready_boot_s = 0.0;
  std::string ready_boot_id = {};
  double submitted_unix_s = 0.0, started_unix_s = 0.0, ended_unix_s = 0.0;
};

/// Rows of jobs. Changes are transactions: no other change comes between reading a row and writing it.
class JobTable {
 public:
  virtual ~JobTable() = default;
  virtual std::optional<Job> find(const store::Id& id) const = 0;
  /// In the order of submission; empty `states`: all.
  virtual std::vector<Job> list(const std::vector<JobState>& states) const = 0;
  /// Hands `choose` the jobs that run (all engines) and at most `most` that are ready for `engine` in the order of submission; those that
  /// it returns (with `given` and `reason` set) become running: attempts + 1, new token, `worker` answers for them. Returns them. Nothing
  /// in `choose` may use the table.
  using Choose = std::function<std::vector<Job>(const std::vector<Job>& running, const std::vector<Job>& ready)>;
  virtual std::vector<Job> claim(store::JobEngine engine, const process::Identity& worker, const Choose& choose, std::size_t max) = 0;
  /// Reads the row, lets `change` edit it, writes it back. False, and nothing is written, when there is no such row or `change` returns
  /// false (it found the row not as expected, e.g. another token).
  virtual bool update(const store::Id& id, const std::function<bool(Job&)>& change) = 0;
};

/// What a claim goes by.
struct ClaimTerms {
  store::JobEngine engine = store::JobEngine::local;
  process::Identity worker;
  std::size_t max = 0;
  double now_boot_s = 0.0;  // of boot_id
  std::string boot_id;
  std::function<bool(const store::Id&)> has_bank;
};
/// The rule of JobTable::claim on all open rows (queued, waiting, running). Returns the rows to be written: claimed ones are running; one
/// that has a bank is done. Pure but for new tokens and the wall clock.
std::vector<Job> calc_claims(const std::vector<Job>& open, const ClaimTerms& terms, const JobTable::Choose& choose);

}  // namespace carillon::registry
