#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <iterator>

#include "jobs/store/outcome/outcome.hpp"
#include "jobs/store/registry/recover.hpp"
#include "runtime/base/clock.hpp"
#include "runtime/base/error.hpp"
#include "tests/unit/jobs/store/registry/jobs.hpp"

namespace carillon::tests {
namespace {

using registry::Job;
using registry::JobState;
using registry::Registry;
namespace fs = std::filesystem;

std::vector<Job> take_all(const std::vector<Job>&, const std::vector<Job>& ready) { return ready; }

void submit(const store::Store& store, Registry& registry, int number) {
  make_work(store, make_submission(number));
  registry.submit({make_submission(number)});
}

TEST(Registry, job_submitted_twice_has_one_row) {
  const Folder folder;
  const store::Store store = store::Store::open(folder / "store");
  Registry registry = Registry::open(store, be_silent);
  make_work(store, make_submission(1));
  registry::Submission again = make_submission(1);
  again.job_file = "/other/place.json";
  EXPECT_EQ(registry.submit({make_submission(1), make_submission(1)}), (std::vector<bool>{true, false}));
  EXPECT_EQ(registry.submit({again}), std::vector<bool>{false});
  EXPECT_EQ(registry.list().size(), 1u);
  EXPECT_EQ(registry.find_last_submission("/other/place.json")->request.id, make_id(1).text());
  EXPECT_EQ(registry.list_last_submissions().size(), 2u);
}

TEST(Registry, every_job_is_claimed_once_by_eight_processes) {
  const Folder folder;
  const store::Store store = store::Store::open(folder / "store");
  constexpr int kJobs = 60;
  {
    Registry registry = Registry::open(store, be_silent);
    for (int n = 0; n < kJobs; ++n) submit(store, registry, n);
  }
  std::vector<pid_t> children;
  for (int n = 0; n < 8; ++n) {
    const pid_t child = ::fork();
    if (child == 0) {
      Registry registry = Registry::open(store, be_silent);
      int claimed = 0;
      const auto first = [](const std::vector<Job>&, const std::vector<Job>& ready) {
        return ready.empty() ? std::vector<Job>() : std::vector<Job>{ready.front()};
      };
      while (!registry.claim(store::JobEngine::local, process::find_self(), first).empty()) ++claimed;
      ::_exit(claimed);
    }
    children.push_back(child);
  }
  int claimed = 0;
  for (const pid_t child : children) {
    int status = 0;
    ::waitpid(child, &status, 0);
    ASSERT_TRUE(WIFEXITED(status));
    claimed += WEXITSTATUS(status);
  }
  EXPECT_EQ(claimed, kJobs);
  for (const Job& job : Registry::open(store, be_silent).list()) EXPECT_EQ(job.attempts, 1);
}

TEST(Registry, only_ready_jobs_are_claimed) {
  const Folder folder;
  const store::Store store = store::Store::open(folder / "store");
  Registry registry = Registry::open(store, be_silent);
  for (int n = 0; n < 5; ++n) submit(store, registry, n);
  const auto wait = [&](int number, double seconds, const std::string& boot) {
    registry.update(make_id(number), [&](Job& job) {
      job.state = JobState::waiting;
      job.ready_boot_s = base::get_boot_s() + seconds;
      job.ready_boot_id = boot;
      return true;
    });
  };
  wait(0, 300, process::find_boot());  // not yet
  wait(1, -1, process::find_boot());   // its time has come
  wait(2, 300, "another boot");        // the machine was restarted
  registry.update(make_id(3), [](Job& job) { return job.engine = store::JobEngine::slurm, true; });
  std::string names;
  for (const Job& job : registry.claim(store::JobEngine::local, process::find_self(), take_all)) names += job.name + " ";
  EXPECT_EQ(names, "1.json 2.json 4.json ");
}

TEST(Registry, done_jobs_are_not_claimed) {
  const Folder folder;
  const store::Store store = store::Store::open(folder / "store");
  Registry registry = Registry::open(store, be_silent);
  submit(store, registry, 1);
  make_bank(store, make_submission(1));  // by another process, meanwhile
  EXPECT_TRUE(registry.claim(store::JobEngine::local, process::find_self(), take_all).empty());
  EXPECT_EQ(registry.find(make_id(1))->state, JobState::done);
}

TEST(Registry, find_by_prefix) {
  const Folder folder;
  const store::Store store = store::Store::open(folder / "store");
  Registry registry = Registry::open(store, be_silent);
  for (int n = 0; n < 40; ++n) submit(store, registry, n);
  EXPECT_EQ(registry.find_by_prefix(make_id(7).text().substr(0, 12)).size(), 1u);
  EXPECT_EQ(registry.find_by_prefix(make_id(7).text()).size(), 1u);
  for (const char* bad : {"", "%", "_", "'; drop table jobs; --", "../"}) EXPECT_TRUE(registry.find_by_prefix(bad).empty()) << bad;
  EXPECT_EQ(registry.list().size(), 40u);
}

TEST(Registry, opening_reconciles_with_the_store) {
  const Folder folder;
  const store::Store store = store::Store::open(folder / "store");
  {
    Registry registry = Registry::open(store, be_silent);
    for (int n = 0; n < 3; ++n) submit(store, registry, n);
  }
  make_bank(store, make_submission(0));
  store.remove_work(make_id(0));
  make_bank(store, make_submission(7));  // no row
  make_work(store, make_submission(8));  // killed before the row
  store.remove_work(make_id(2));         // by hand
  const Registry registry = Registry::open(store, be_silent);
  const auto state = [&](int n) { return to_text(registry.find(make_id(n))->state); };
  EXPECT_EQ(state(0) + state(1) + state(2) + state(7) + state(8), "donequeuedfaileddonequeued");
  EXPECT_NE(registry.find(make_id(2))->reason.find("submit the job again"), std::string::npos);
}

TEST(Registry, job_with_a_live_attempt_is_running) {
  const Folder folder;
  const store::Store store = store::Store::open(folder / "store");
  make_work(store, make_submission(1));
  outcome::Attempt attempt;
  attempt.token = store::make_random_name();
  attempt.process = process::find_self();
  attempt.started = outcome::find_utc();
  outcome::write_attempt(store.work_folder(make_id(1)), attempt);
  {
    const Registry registry = Registry::open(store, be_silent);
    EXPECT_EQ(registry.find(make_id(1))->state, JobState::running);
    EXPECT_EQ(registry.find(make_id(1))->token, attempt.token);
  }
  attempt.process.start_ticks += 1;  // its number is another process's by now
  outcome::write_attempt(store.work_folder(make_id(1)), attempt);
  fs::remove(folder / "store/registry.sqlite");
  EXPECT_EQ(Registry::open(store, be_silent).find(make_id(1))->state, JobState::queued);
}

TEST(Registry, read_only_registry) {
  const Folder folder;
  std::string wanted;
  {
    const store::Store store = store::Store::open(folder / "store");
    Registry registry = Registry::open(store, be_silent);
    for (int n = 0; n < 4; ++n) submit(store, registry, n);
    make_bank(store, make_submission(0));
    store.remove_work(make_id(0));
    registry.update(make_id(0), [](Job& job) { return job.state = JobState::done, true; });
    registry.update(make_id(1),
                    [](Job& job) { return job.state = JobState::failed, job.reason = "the mesh is bad", job.failures = 1, true; });
    wanted = describe(registry);
  }
  const fs::path file = folder / "store/registry.sqlite";
  const std::string bytes = read_all(file);
  const auto moment = fs::last_write_time(file);
  const store::Store store = store::Store::open_to_read(folder / "store");
  Registry registry = Registry::open_to_read(store);
  EXPECT_EQ(describe(registry), wanted);
  EXPECT_EQ(registry.find_last_submission("/jobs/1.json")->request.id, make_id(1).text());
  EXPECT_EQ(registry.find_by_prefix(make_id(3).text().substr(0, 12)).size(), 1u);
  EXPECT_THROW(registry.submit({make_submission(9)}), InputError);
  EXPECT_THROW(registry.update(make_id(1), [](Job&) { return true; }), InputError);
  EXPECT_THROW(registry.claim(store::JobEngine::local, process::find_self(), take_all), InputError);
  EXPECT_THROW(registry.remove({make_id(1)}), InputError);
  EXPECT_THROW(registry.keep_submissions({}), InputError);
  EXPECT_EQ(read_all(file), bytes);
  EXPECT_EQ(fs::last_write_time(file), moment);
  EXPECT_FALSE(fs::exists(file.string() + "-wal"));
  fs::remove(file);
  EXPECT_EQ(describe(Registry::open_to_read(store)), wanted);
  EXPECT_FALSE(fs::exists(file));
}

/// Six jobs in different states, and a copy of their registry file.
class Rebuild : public testing::Test {
 protected:
  Rebuild() : store_(store::Store::open(folder_ / "store")) {
    Registry registry = Registry::open(store_, be_silent);
    for (int n = 0; n < 6; ++n) submit(store_, registry, n);
    make_bank(store_, make_submission(0));
    store_.remove_work(make_id(0));
    registry.update(make_id(0), [](Job& job) { return job.state = JobState::done, true; });
    registry.update(make_id(1), [](Job& job) { return job.state = JobState::failed, job.reason = "bad mesh", job.failures = 1, true; });
    registry.update(make_id(2), [](Job& job) { return job.state = JobState::cancelled, job.reason = "cancelled", true; });
    wanted_ = describe(registry);
  }

  /// Replaces the file, opens the registry, and expects one message and all jobs.
  void check(const std::string& bytes) const {
    for (const char* ending : {"-wal", "-shm"}) fs::remove(file_.string() + ending);
    folder_.write("store/registry.sqlite", bytes);
    int messages = 0;
    const Registry registry = Registry::open(store_, [&](const std::string&) { ++messages; });
    EXPECT_EQ(describe(registry), wanted_) << bytes.size();
    EXPECT_EQ(registry.list_last_submissions().size(), 6u);
    EXPECT_LE(messages, 1);
  }

  const Folder folder_;
  const store::Store store_;
  const fs::path file_ = folder_ / "store/registry.sqlite";
  std::string wanted_;
};

TEST_F(Rebuild, truncated_file) {
  const std::string whole = read_all(file_);
  ASSERT_GT(whole.size(), 8000u);
  for (std::size_t bytes = 0; bytes < whole.size(); bytes += 509) check(whole.substr(0, bytes));
}

TEST_F(Rebuild, file_that_is_not_a_database) { check("not a database " + std::string(5000, 'x')); }

TEST_F(Rebuild, file_of_another_version) {
  std::string bytes = read_all(file_);
  bytes[63] = 1;  // user_version, sqlite.org, fileformat2.html
  check(bytes);
}

TEST_F(Rebuild, file_deleted_while_open) {
  Registry registry = Registry::open(store_, be_silent);
  fs::remove(file_);
  EXPECT_EQ(describe(registry), wanted_);
  EXPECT_TRUE(registry.update(make_id(3), [](Job& job) { return job.state = JobState::failed, job.reason = "x", true; }));
  EXPECT_EQ(Registry::open(store_, be_silent).find(make_id(3))->state, JobState::failed);
}

TEST_F(Rebuild, file_damaged_while_open) {
  Registry registry = Registry::open(store_, be_silent);
  std::string bytes = read_all(file_);
  std::fill(bytes.begin() + 4096, bytes.end(), 'x');
  std::fstream(file_, std::ios::in | std::ios::out | std::ios::binary) << bytes;
  EXPECT_EQ(describe(registry), wanted_);
}

TEST(Registry, hostile_names_stay_text) {
  const Folder folder;
  const store::Store store = store::Store::open(folder / "store");
  Registry registry = Registry::open(store, be_silent);
  int number = 0;
  for (const std::string& name :
       {std::string("/a/'; drop table jobs; --"), std::string("/a/\"; rm -rf /\n.json"), std::string("/a/\x1b[2J"),
        "/a/" + std::string(4096, 'x'), std::string("/a/../../../x"), std::string("/a/\xe2\x80\xae.json")}) {
    registry::Submission submission = make_submission(++number);
    submission.job_file = submission.request.job_file = name;
    make_work(store, submission);
    registry.submit({submission});
    EXPECT_EQ(registry.find_last_submission(name)->request.id, make_id(number).text());
  }
  fs::remove(folder / "store/registry.sqlite");
  const Registry again = Registry::open(store, be_silent);
  EXPECT_EQ(again.list().size(), static_cast<std::size_t>(number));
  EXPECT_EQ(again.find_last_submission("/a/'; drop table jobs; --")->request.id, make_id(1).text());
}

TEST(SubmissionLog, truncation_loses_only_the_last_line) {
  const Folder folder;
  const store::Store store = store::Store::open(folder / "store");
  std::vector<registry::Submission> all{make_submission(1), make_submission(2), make_submission(3)};
  registry::append_submissions(store, all);
  const std::filesystem::path file = store.root() / "submissions.jsonl";
  std::ifstream stream(file, std::ios::binary);
  const std::string whole{std::istreambuf_iterator<char>(stream), {}};
  const auto cut = [&](std::size_t bytes) { std::ofstream(file, std::ios::binary) << whole.substr(0, bytes); };
  for (std::size_t bytes = 0; bytes <= whole.size(); ++bytes) {
    cut(bytes);
    // A line is whole when its last brace is there, whether or not its end of line is.
    const std::size_t lines = std::count(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(bytes), '\n');
    const bool has_unended = bytes > 0 && bytes < whole.size() && whole[bytes] == '\n';
    const auto found = registry::read_submission_log(store);
    ASSERT_EQ(found.size(), lines + (has_unended ? 1 : 0)) << bytes;
    for (std::size_t i = 0; i < found.size(); ++i) ASSERT_EQ(found[i].request.id, all[i].request.id) << bytes;
    if (bytes % 17 != 0) continue;
    registry::append_submissions(store, {make_submission(4)});  // behind a line that was cut
    ASSERT_EQ(registry::read_submission_log(store).back().request.id, make_submission(4).request.id) << bytes;
  }
}

}  // namespace
}  // namespace carillon::tests
