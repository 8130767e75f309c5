// A job as a row, and the interface of the table for the queue.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "jobs/store/id.hpp"
#include "jobs/store/process/process.hpp"
#include "jobs/store/records.hpp"

namespace carillon::registry {

using store::JobState;
using store::to_text;

/// Wall clock, seconds since 1970. For display only.
double find_unix_seconds();
/// File name of a job file.
std::string find_name(const std::string& job_file);

struct Job {
  store::Id id;
  /// running: `worker` is the process of the attempt or, before that is known, the process that claimed the job. waiting: until
  /// `ready_boot_s` of boot `ready_boot_id` (any other boot: ready now).
  JobState state = JobState::queued;
  std::string name = {};  // of the job file submitted last, for display
  store::JobEngine engine = store::JobEngine::local;
  store::Resources resources = {};  // requested
  store::Resources given = {};      // ranks and memory chosen by the queue for the last attempt
  std::string reason = {};          // one sentence: why it failed, waits or was cancelled
  std::string token = {};           // of the attempt, 32 hex digits; empty before the first attempt
  process::Identity worker = {};    // see `state`
  std::string slurm_job = {};       // "123", "123_4", or "123_4.7" in a task with several jobs
  bool cancel_wanted = false;       // a running job shall end
  int attempts = 0;
  int failures = 0;  // consecutive failed attempts
  double ready_boot_s = 0.0;
  std::string ready_boot_id = {};
  double submitted_unix_s = 0.0, started_unix_s = 0.0, ended_unix_s = 0.0;
};

/// Rows of jobs. Every change is a transaction.
class JobTable {
 public:
  virtual ~JobTable() = default;
  virtual std::optional<Job> find(const store::Id& id) const = 0;
  /// In the order of submission; empty `states`: all.
  virtual std::vector<Job> list(const std::vector<JobState>& states) const = 0;
  /// Open rows of an engine.
  std::vector<Job> list_open(store::JobEngine engine) const;
  /// Calls `choose` with the running jobs (all engines) and at most `max` jobs that are ready for `engine`, in the order of submission. The
  /// jobs it returns (with `given` and `reason` set) become running: attempts + 1, new token, claimed by `worker`. Returns them. `choose`
  /// must not use the table.
  using Choose = std::function<std::vector<Job>(const std::vector<Job>& running, const std::vector<Job>& ready)>;
  virtual std::vector<Job> claim(store::JobEngine engine, const process::Identity& worker, const Choose& choose, std::size_t max) = 0;
  /// Reads the row, calls `change`, writes it back. False, and nothing is written, without such a row or if `change` returns false.
  virtual bool update(const store::Id& id, const std::function<bool(Job&)>& change) = 0;
};

/// Input of calc_claims().
struct ClaimTerms {
  store::JobEngine engine = store::JobEngine::local;
  process::Identity worker;
  std::size_t max = 0;
  double now_boot_s = 0.0;  // of boot_id
  std::string boot_id;
  std::function<bool(const store::Id&)> has_bank;
};
/// The rule of JobTable::claim() on all open rows (queued, waiting, running). Returns the changed rows: claimed ones are running, those
/// with a bank done. Pure, except for new tokens and the wall clock.
std::vector<Job> calc_claims(const std::vector<Job>& open, const ClaimTerms& terms, const JobTable::Choose& choose);

}  // namespace carillon::registry
