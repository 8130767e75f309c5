// Method:     Every change is one write transaction that reads a row, changes it and writes it. Reasons and counts are also written to
//             state.json of the job, before the transaction is committed, so that a rebuilt registry has them.
// Source:     sqlite.org, lang_transaction.html, wal.html.
#include "jobs/store/registry/registry.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "jobs/store/files.hpp"
#include "jobs/store/registry/database.hpp"
#include "jobs/store/registry/recover.hpp"
#include "jobs/store/registry/rows.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/base/descriptor.hpp"
#include "runtime/base/error.hpp"

namespace carillon::registry {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFileName = "registry.sqlite";

/// Device and inode of a file; zeros if it does not exist.
std::pair<dev_t, ino_t> find_file(const fs::path& file) {
  struct stat info {};
  return ::stat(file.c_str(), &info) == 0 ? std::pair(info.st_dev, info.st_ino) : std::pair<dev_t, ino_t>(0, 0);
}

/// Creates an empty file with the umask of the store's group; SQLite gives the same mode to the files next to it.
void make_file(const fs::path& file) {
  const base::Descriptor made(::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666));
  if (made.get() < 0) store::throw_errno(file, "create the registry", errno);
}

void remove_file(const fs::path& file) {
  for (const char* ending : {"", "-journal", "-wal", "-shm"}) {
    if (::unlink((fs::path(file) += ending).c_str()) != 0 && errno != ENOENT)
      store::throw_errno(file, "remove this damaged registry", errno);
  }
}

void write_state(const store::Store& store, const Job& job) {
  if (job.state == JobState::running || job.state == JobState::done || !store.has_work(job.id)) return;
  store::write_state(store.work_folder(job.id), {job.state, job.reason, job.attempts, job.failures});
}

}  // namespace

struct Registry::Data {
  store::Store store;
  Say say;
  fs::path file;  // empty: in memory, for reading
  std::unique_ptr<Database> database;
  std::pair<dev_t, ino_t> opened{};

  /// Opens the file; removes and rebuilds a damaged one. `damage`: found in the open one; empty: none.
  void open(std::string damage = "") {
    database.reset();
    const store::Lock lock(file.parent_path() / "registry.lock", LOCK_EX);  // one process rebuilds
    if (!damage.empty() && find_file(file) == opened) remove_file(file);
    for (int round = 0; round < 2; ++round) {
      try {
        make_file(file);
        database = std::make_unique<Database>(file);
        fill_if_empty(damage);
        opened = find_file(file);
        return;
      } catch (const Damaged& error) {
        database.reset();
        remove_file(file);
        damage = error.what();
      }
    }
    throw SystemError(fmt::format("{}: the new registry is damaged too ({}); check the disk", file.string(), damage));
  }

  void fill_if_empty(const std::string& damage) {
    Transaction transaction(*database);
    if (!make_tables(*database)) return;
    const std::size_t jobs = fill_from_store(*database, store);
    transaction.commit();
    if (!damage.empty())
      say(fmt::format("the registry was damaged ({}) and is rebuilt from the store: {} job{}", damage, jobs, jobs == 1 ? "" : "s"));
    else if (jobs > 0)
      say(fmt::format("the registry was missing and is rebuilt from the store: {} job{}", jobs, jobs == 1 ? "" : "s"));
  }

  void require_writing() const {
    if (!file.empty()) return;
    throw InputError(
        fmt::format("{}: read-only store; ask its owner for write access, or choose another with --store", store.root().string()));
  }

  /// Runs `act` on the registry; on the new one if the file was replaced by another process or proves damaged.
  template <class Act>
  auto guard(const Act& act) {
    if (file.empty()) return act(*database);
    if (find_file(file) != opened) open();
    try {
      return act(*database);
    } catch (const Damaged& error) {
      open(error.what());
      return act(*database);
    }
  }
};

Registry::Registry(std::unique_ptr<Data> data) : data_(std::move(data)) {}
Registry::Registry(Registry&&) noexcept = default;
Registry::~Registry() = default;

Registry Registry::open(const store::Store& store, const std::function<void(const std::string&)>& say) {
  auto data = std::make_unique<Data>(Data{store, say, store.registry_folder() / kFileName, nullptr, {}});
  data->open();
  data->guard([&](Database& database) { reconcile(database, store, say); });
  return Registry(std::move(data));
}

Registry Registry::open_to_read(const store::Store& store) {
  auto database = std::make_unique<Database>();
  Transaction transaction(*database);
  make_tables(*database);
  fill_from_store(*database, store);
  transaction.commit();
  return Registry(std::make_unique<Data>(Data{store, {}, {}, std::move(database), {}}));
}

std::vector<bool> Registry::submit(const std::vector<Submission>& submissions) {
  data_->require_writing();
  append_submissions(data_->store, submissions);
  return data_->guard([&](Database& database) {
    std::vector<bool> is_new;
    Transaction transaction(database);
    long long seq = find_next_seq(database);
    for (const Submission& submission : submissions) {
      const store::Request& request = submission.request;
      Job job{store::require_id(request.id, "submission")};
      job.state = data_->store.has_bank(job.id) ? JobState::done : JobState::queued;
      job.name = find_name(submission.job_file);
      job.engine = request.engine;
      job.resources = request.resources;
      job.submitted_unix_s = request.submitted_unix_s;
      is_new.push_back(insert_job(database, job, seq));
      write_submission(database, submission, seq++);
    }
    transaction.commit();
    return is_new;
  });
}

std::optional<Job> Registry::find(const store::Id& id) const {
  return data_->guard([&](Database& database) { return read_job(database, id); });
}

std::vector<Job> Registry::find_by_prefix(std::string_view prefix, std::size_t max) const {
  const bool is_hex = std::all_of(prefix.begin(), prefix.end(), [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f'); });
  if (!is_hex || prefix.empty()) return {};
  return data_->guard([&](Database& database) {
    std::vector<Job> jobs = read_jobs(database, "where id >= ? and id < ?", {std::string(prefix), std::string(prefix) + "g"});
    if (jobs.size() > max) jobs.erase(jobs.begin() + static_cast<std::ptrdiff_t>(max), jobs.end());
    return jobs;
  });
}

std::vector<Job> Registry::list(const std::vector<JobState>& states) const {
  return data_->guard([&](Database& database) {
    if (states.empty()) return read_jobs(database);
    std::string condition = "where state in (";
    for (const JobState state : states) condition += fmt::format("{}'{}'", condition.ends_with('(') ? "" : ", ", to_text(state));
    if (std::all_of(states.begin(), states.end(), store::is_open))
      condition += ") and state in ('queued', 'waiting', 'running'";  // uses the index
    return read_jobs(database, condition + ")");
  });
}

std::optional<Submission> Registry::find_last_submission(const std::string& job_file) const {
  if (job_file.empty()) return std::nullopt;
  return data_->guard([&](Database& database) {
    std::vector<Submission> found = read_submissions(database, job_file);
    return found.empty() ? std::nullopt : std::optional(found.front());
  });
}

std::vector<Submission> Registry::list_last_submissions() const {
  return data_->guard([&](Database& database) { return read_submissions(database); });
}

std::vector<Job> Registry::claim(store::JobEngine engine, const process::Identity& worker, const Choose& choose, std::size_t max) {
  data_->require_writing();
  return data_->guard([&](Database& database) {
    Transaction transaction(database);
    const ClaimTerms terms{
        engine, worker, max, base::get_boot_s(), process::find_boot(), [&](const store::Id& id) { return data_->store.has_bank(id); }};
    std::vector<Job> changed = calc_claims(read_jobs(database, "where state in ('queued', 'waiting', 'running')"), terms, choose);
    for (const Job& job : changed) update_job(database, job);
    transaction.commit();
    std::erase_if(changed, [](const Job& job) { return job.state != JobState::running; });
    return changed;
  });
}

bool Registry::update(const store::Id& id, const std::function<bool(Job&)>& change) {
  data_->require_writing();
  return data_->guard([&](Database& database) {
    Transaction transaction(database);
    const auto known = read_job(database, id);
    if (!known) return false;
    Job job = *known;
    if (!change(job)) return false;
    write_state(data_->store, job);
    update_job(database, job);
    transaction.commit();
    return true;
  });
}

void Registry::remove(const std::vector<store::Id>& ids) {
  data_->require_writing();
  data_->guard([&](Database& database) {
    Transaction transaction(database);
    for (const store::Id& id : ids) {
      Statement row(database, "delete from jobs where id = ? and state in ('failed', 'cancelled', 'done')");
      row.bind(id.text()).step();
    }
    transaction.commit();
  });
}

void Registry::keep_submissions(const std::vector<Submission>& submissions) {
  data_->require_writing();
  rewrite_submission_log(data_->store, submissions);
  data_->guard([&](Database& database) {
    Transaction transaction(database);
    database.run("delete from submissions");
    long long seq = find_next_seq(database);
    for (const Submission& submission : submissions) write_submission(database, submission, seq++);
    transaction.commit();
  });
}

double find_unix_seconds() {
  timespec time{};
  ::clock_gettime(CLOCK_REALTIME, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace carillon::registry
