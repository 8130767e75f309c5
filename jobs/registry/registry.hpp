// The registry: which jobs there are, what state they are in, who asked for them. An index over the store: banks/ and work/ are the truth,
// and a registry that is lost or damaged is set aside and made again from them. SQLite in WAL mode, synchronous=FULL; one host only.
// One Registry per thread; any number of processes.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "jobs/process/process.hpp"
#include "jobs/store/id.hpp"
#include "jobs/store/records.hpp"
#include "jobs/store/store.hpp"

namespace carillon::registry {

/// queued: may be claimed. running: claimed; `worker` is the process of the attempt, before it is known the one that claimed. waiting: as
/// queued, but not before `ready_boot_s` of boot `ready_boot_id` (another boot: at once). done, failed, cancelled: ended.
enum class State { queued, running, waiting, done, failed, cancelled };
std::string to_text(State state);

/// The wall clock, seconds since 1970: for people, never for decisions.
double find_unix_seconds();
/// The last part of a job file's name.
std::string find_name(const std::string& job_file);

struct Job {
  store::Id id;
  State state = State::queued;
  std::string name = {};            // of the job file that asked last, for people
  std::string engine = "local";     // "local" or "slurm"
  store::Resources resources = {};  // as asked for
  store::Resources given = {};      // ranks and memory of the last attempt, as the queue chose them
  std::string reason = {};          // one sentence: why it failed, waits, or was cancelled
  std::string token = {};           // of the attempt, 32 hex digits; empty before the first
  process::Identity worker = {};    // of the attempt; of the one who claimed, before that is known
  std::string slurm_job = {};       // "123" or "123_4"
  bool cancel_wanted = false;       // somebody asked a running job to end
  int attempts = 0;
  int failures = 0;  // attempts that count against the retries
  double ready_boot_s = 0.0;
  std::string ready_boot_id = {};
  double submitted_unix_s = 0.0, started_unix_s = 0.0, ended_unix_s = 0.0;
};

/// One request of one job file.
struct Submission {
  std::string job_file;  // store::to_text() of an absolute path, with "#7" for line 7 of a manifest
  store::Request request;
};

class Registry {
 public:
  /// Opens the store's registry; a damaged one is set aside and rebuilt, and `say` gets one line about it. Then brings it up to date with
  /// the store: folders without a row get one, a row whose bank is there is done, a done row whose bank is gone is failed.
  static Registry open(const store::Store& store, const std::function<void(const std::string&)>& say);
  /// For who may only read the store: its jobs as its folders and its log of submissions tell them now, in memory; the registry's own file
  /// is neither opened nor made. What folders do not tell (ranks given, times, numbers of Slurm) is as in a new row. What changes jobs
  /// throws InputError.
  static Registry open_to_read(const store::Store& store);
  Registry(Registry&&) noexcept;
  ~Registry();

  /// Inserts each job unless there is a row; a failed or cancelled row stays. One transaction. Per submission: true when a row was made.
  std::vector<bool> submit(const std::vector<Submission>& submissions);

  std::optional<Job> find(const store::Id& id) const;
  /// All rows whose id begins with `prefix` (hex digits), at most `most`.
  std::vector<Job> find_by_prefix(std::string_view prefix, std::size_t most = 10) const;
  /// In the order of submission; empty `states`: all.
  std::vector<Job> list(const std::vector<State>& states = {}) const;
  /// The newest submission of a job file; of all job files, the newest of each.
  std::optional<Submission> find_last_submission(const std::string& job_file) const;
  std::vector<Submission> list_last_submissions() const;

  /// In one write transaction: hands `choose` the jobs that run (all engines) and at most `most` that are ready for `engine` in the order
  /// of submission; those that it returns (with `given` and `reason` set) become running: attempts + 1, new token, `runner` answers
  /// for them. Returns them. Nothing in `choose` may use the registry.
  using Choose = std::function<std::vector<Job>(const std::vector<Job>& running, const std::vector<Job>& ready)>;
  std::vector<Job> claim(const std::string& engine, const process::Identity& worker, const Choose& choose, std::size_t most = 1000);

  /// Reads the row in a write transaction, lets `change` edit it, writes it back. False, and nothing is written, when there is no such row
  /// or `change` returns false (it found the row not as expected, e.g. another token).
  bool update(const store::Id& id, const std::function<bool(Job&)>& change);

  /// Forgets rows that have ended (gc); others stay.
  void remove(const std::vector<store::Id>& ids);
  /// Forgets all submissions but these (gc); the caller holds store::Store::lock_exclusive().
  void keep_submissions(const std::vector<Submission>& submissions);

 private:
  struct Data;
  explicit Registry(std::unique_ptr<Data> data);
  std::unique_ptr<Data> data_;
};

}  // namespace carillon::registry
