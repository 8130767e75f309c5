// The registry: the jobs of a store with their states and submissions, in SQLite (WAL, synchronous=FULL). It is only an index over banks/,
// work/ and submissions.jsonl: it may be deleted at any time, and is rebuilt when missing or damaged. One host; one Registry per thread;
// any number of processes.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "jobs/store/id.hpp"
#include "jobs/store/process/process.hpp"
#include "jobs/store/records.hpp"
#include "jobs/store/registry/job_table.hpp"
#include "jobs/store/store.hpp"

namespace carillon::registry {

/// One request of one job file.
struct Submission {
  std::string job_file;  // store::to_text() of an absolute path, with "#7" for line 7 of a manifest
  store::Request request;
};

/// The rows of all jobs of a store. Every change is one transaction. Times, given ranks and Slurm job numbers are lost in a rebuild.
class Registry final : public JobTable {
 public:
  /// Opens the registry of a store; rebuilds a missing or damaged one and reports that in one line to `say`. Then updates it: folders
  /// without a row get one, rows with a bank become done, done rows without a bank failed.
  static Registry open(const store::Store& store, const std::function<void(const std::string&)>& say);
  /// For read-only stores: a registry in memory, built from the folders and the log of submissions. Calls that change jobs throw
  /// InputError.
  static Registry open_to_read(const store::Store& store);
  Registry(Registry&&) noexcept;
  ~Registry() override;

  /// Inserts each job that has no row, in one transaction. Per submission: true if a row was inserted.
  std::vector<bool> submit(const std::vector<Submission>& submissions);

  std::optional<Job> find(const store::Id& id) const override;
  /// At most `max` rows whose id begins with `prefix` (hex digits).
  std::vector<Job> find_by_prefix(std::string_view prefix, std::size_t max = 10) const;
  std::vector<Job> list(const std::vector<JobState>& states) const override;
  std::vector<Job> list() const { return list({}); }
  /// The newest submission of a job file, and of every job file.
  std::optional<Submission> find_last_submission(const std::string& job_file) const;
  std::vector<Submission> list_last_submissions() const;

  /// Each in one write transaction.
  std::vector<Job> claim(store::JobEngine engine, const process::Identity& worker, const Choose& choose, std::size_t max = 1000) override;
  bool update(const store::Id& id, const std::function<bool(Job&)>& change) override;

  /// Deletes rows that have ended (gc).
  void remove(const std::vector<store::Id>& ids);
  /// Deletes all other submissions (gc). The caller holds store::Store::lock_exclusive().
  void keep_submissions(const std::vector<Submission>& submissions);

 private:
  struct Data;
  explicit Registry(std::unique_ptr<Data> data);
  std::unique_ptr<Data> data_;
};

}  // namespace carillon::registry
