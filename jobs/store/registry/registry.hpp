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

#include "jobs/store/process/process.hpp"
#include "jobs/store/registry/job_table.hpp"
#include "jobs/store/id.hpp"
#include "jobs/store/records.hpp"
#include "jobs/store/store.hpp"

namespace carillon::registry {

/// One request of one job file.
struct Submission {
  std::string job_file;  // store::to_text() of an absolute path, with "#7" for line 7 of a manifest
  store::Request request;
};

/// The rows of all jobs of a store. Every change is one transaction, so that other processes see rows before or after it. All of it can be
/// made again from the store but times, ranks given and numbers of Slurm.
class Registry final : public JobTable {
 public:
  /// Opens the store's registry; a damaged one is set aside and rebuilt, and `say` gets one line about it. Then brings it up to date with
  /// the store: folders without a row get one, a row whose bank is there is done, a done row whose bank is gone is failed.
  static Registry open(const store::Store& store, const std::function<void(const std::string&)>& say);
  /// For who may only read the store: its jobs as its folders and its log of submissions show them now, in memory; the registry's own file
  /// is neither opened nor made. What folders do not record (ranks given, times, numbers of Slurm) is as in a new row. What changes jobs
  /// throws InputError.
  static Registry open_to_read(const store::Store& store);
  Registry(Registry&&) noexcept;
  ~Registry() override;

  /// Inserts each job unless there is a row; a failed or cancelled row stays. One transaction. Per submission: true when a row was made.
  std::vector<bool> submit(const std::vector<Submission>& submissions);

  std::optional<Job> find(const store::Id& id) const override;
  /// All rows whose id begins with `prefix` (hex digits), at most `most`.
  std::vector<Job> find_by_prefix(std::string_view prefix, std::size_t max = 10) const;
  std::vector<Job> list(const std::vector<JobState>& states) const override;
  std::vector<Job> list() const { return list({}); }
  /// The newest submission of a job file; of all job files, the newest of each.
  std::optional<Submission> find_last_submission(const std::string& job_file) const;
  std::vector<Submission> list_last_submissions() const;

  /// Each in one write transaction.
  std::vector<Job> claim(store::JobEngine engine, const process::Identity& worker, const Choose& choose, std::size_t max = 1000) override;
  bool update(const store::Id& id, const std::function<bool(Job&)>& change) override;

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
