// Method:     Every change is one write transaction of SQLite that reads the row, changes it and writes it whole. What could not be
//             read from the store again (reasons, counts) is written next to the job, in state.json, before the transaction is committed.
// Source:     sqlite.org, lang_transaction.html, wal.html.
// Deviations: none.
#include "jobs/store/registry/registry.hpp"

#include <fcntl.h>
#include <fmt/core.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "jobs/store/registry/database.hpp"
#include "jobs/store/registry/recover.hpp"
#include "jobs/store/registry/rows.hpp"
#include "jobs/store/files.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/base/error.hpp"

namespace carillon::registry {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFileName = "registry.sqlite";
constexpr int kMaxRepairs = 3;

/// Device and number of a file; zeros when there is none.
std::pair<dev_t, ino_t> find_file(const fs::path& file) {
  struct stat info {};
  return ::stat(file.c_str(), &info) == 0 ? std::pair(info.st_dev, info.st_ino) : std::pair<dev_t, ino_t>(0, 0);
}

/// Makes the file unless it is there: its group gets the rights of the store, and SQLite gives the same to the files next to it.
void make_file(const fs::path& file) {
  struct stat info {};
  for (const char* ending : {"-journal", "-wal", "-shm"}) {
    const fs::path companion = fs::path(file) += ending;
    if (::lstat(companion.c_str(), &info) != 0 || S_ISREG(info.st_mode)) continue;
    throw InputError(fmt::format("{}: {}, and the registry keeps a file of its own here; find out who put it there, and remove it",
                                 companion.string(), S_ISLNK(info.st_mode) ? "this is a link" : "this is something else"));
  }
  if (::lstat(file.c_str(), &info) == 0) {
    if (!S_ISREG(info.st_mode))
      throw InputError(fmt::format("{}: the registry must be a regular file; remove what is there", file.string()));
    return;
  }
  const int fd = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0666);
  if (fd < 0) store::throw_errno(file, "make the registry", errno);
  ::close(fd);
}

/// Held while the registry is opened, so that one process alone sets a damaged one aside.
class Gate {
 public:
  explicit Gate(const fs::path& folder)
      : descriptor_(::open((folder / "registry.lock").c_str(), O_RDONLY | O_CREAT | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK, 0664)) {
    if (descriptor_ < 0) store::throw_errno(folder / "registry.lock", "open", errno);
    while (::flock(descriptor_, LOCK_EX) != 0) {
      if (errno != EINTR) store::throw_errno(folder / "registry.lock", "lock", errno);
    }
  }
  ~Gate() { ::close(descriptor_); }
  Gate(const Gate&) = delete;
  Gate& operator=(const Gate&) = delete;

 private:
  int descriptor_;
};

store::SavedState make_saved_state(const Job& job) { return {job.state, job.reason, job.attempts, job.failures}; }

/// Next to the job, for a registry that has to be made again.
void write_state(const store::Store& store, const Job& job) {
  if (job.state == JobState::running || job.state == JobState::done || !store.has_work(job.id)) return;
  const store::OpenFolder work = store.open_work(job.id);
  try {
    store::write_state(work.path(), make_saved_state(job));
  } catch (const SystemError& error) {
    store::throw_with_names(work, error);
  }
}

}  // namespace

struct Registry::Data {
  store::Store store;
  Say say;
  fs::path file;  // empty: in memory, for reading
  std::unique_ptr<Database> database;
  std::pair<dev_t, ino_t> opened{};

  /// Opens, checks, and rebuilds what is damaged.
  void open() {
    database.reset();
    const Gate gate(file.parent_path());
    std::string damage;
    for (int repairs = 0; repairs < kMaxRepairs; ++repairs) {
      try {
        make_file(file);
        database = std::make_unique<Database>(file);
        const bool is_new = fill_if_empty(damage);
        if (!is_new) check_tables(*database);
        opened = find_file(file);
        return;
      } catch (const Damaged& error) {
        database.reset();
        damage = fmt::format("{}; it is kept as {}", error.what(), set_aside(file).filename().string());
      }
    }
    throw SystemError(fmt::format("{}: the registry is damaged as soon as it is made ({}); check the disk", file.string(), damage));
  }

  bool fill_if_empty(const std::string& damage) {
    Transaction transaction(*database);
    if (!make_tables(*database)) return false;
    const std::size_t jobs = fill_from_store(*database, store);
    transaction.commit();
    if (!damage.empty())
      say(fmt::format("the registry was damaged ({}) and is made again from the store: {} job{}", damage, jobs, jobs == 1 ? "" : "s"));
    else if (jobs > 0)
      say(fmt::format("the registry was gone and is made again from the store: {} job{}", jobs, jobs == 1 ? "" : "s"));
    return true;
  }

  void require_writing() const {
    if (!file.empty()) return;
    throw InputError(fmt::format("{}: this store may only be read; ask its owner for the right to write, or choose another with --store",
                                 store.root().string()));
  }

  /// Runs `act` on the registry of now; when that proves damaged or was replaced meanwhile, on the one that is made in its place.
  template <class Act>
  auto guard(const Act& act) {
    if (file.empty()) return act(*database);
    if (find_file(file) != opened) open();
    try {
      return act(*database);
    } catch (const Damaged&) {
      open();
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
    const bool is_open = std::none_of(states.begin(), states.end(), [](JobState state) {
      return state == JobState::done || state == JobState::failed || state == JobState::cancelled;
    });
    if (is_open) condition += ") and state in ('queued', 'waiting', 'running'";  // so that the index serves
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
