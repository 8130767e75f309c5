#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "jobs/outcome/outcome.hpp"
#include "tests/registry/jobs.hpp"

namespace {

using namespace carillon;
using carillon::tests::Folder;
using carillon::tests::make_id;
using carillon::tests::make_submission;
using registry::Job;
using registry::Registry;
using registry::State;

std::vector<Job> take_all(const std::vector<Job>&, const std::vector<Job>& ready) { return ready; }

void submit(const store::Store& store, Registry& registry, int number) {
  tests::make_work(store, make_submission(number));
  registry.submit({make_submission(number)});
}

TEST(Registry, a_job_that_is_submitted_twice_has_one_row) {
  const Folder folder;
  const store::Store store = store::Store::open(folder / "store");
  Registry registry = Registry::open(store, tests::be_silent);
  tests::make_work(store, make_submission(1));
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
    Registry registry = Registry::open(store, tests::be_silent);
    for (int n = 0; n < kJobs; ++n) submit(store, registry, n);
  }
  std::vector<pid_t> children;
  for (int n = 0; n < 8; ++n) {
    const pid_t child = ::fork();
    if (child == 0) {
      Registry registry = Registry::open(store, tests::be_silent);
      int claimed = 0;
      const auto first = [](const std::vector<Job>&, const std::vector<Job>& ready) {
        return ready.empty() ? std::vector<Job>() : std::vector<Job>{ready.front()};
      };
      while (!registry.claim("local", process::find_self(), first).empty()) ++claimed;
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
  for (const Job& job : Registry::open(store, tests::be_silent).list()) EXPECT_EQ(job.attempts, 1);
}

TEST(Registry, only_what_is_ready_is_handed_out) {
  const Folder folder;
  const store::Store store = store::Store::open(folder / "store");
  Registry registry = Registry::open(store, tests::be_silent);
  for (int n = 0; n < 5; ++n) submit(store, registry, n);
  const auto wait = [&](int number, double seconds, const std::string& boot) {
    registry.update(make_id(number), [&](Job& job) {
      job.state = State::waiting;
      job.ready_boot_s = process::find_boot_seconds() + seconds;
      job.ready_boot_id = boot;
      return true;
    });
  };
  wait(0, 300, process::find_boot());  // not yet
  wait(1, -1, process::find_boot());   // its time has come
  wait(2, 300, "another boot");        // the machine was started anew
  registry.update(make_id(3), [](Job& job) { return job.engine = "slurm", true; });
  std::string names;
  for (const Job& job : registry.claim("local", process::find_self(), take_all)) names += job.name + " ";
  EXPECT_EQ(names, "1.json 2.json 4.json ");
}

TEST(Registry, what_is_done_is_never_claimed) {
  const Folder folder;
  const store::Store store = store::Store::open(folder / "store");
  Registry registry = Registry::open(store, tests::be_silent);
  submit(store, registry, 1);
  tests::make_bank(store, make_submission(1));  // by somebody else, meanwhile
  EXPECT_TRUE(registry.claim("local", process::find_self(), take_all).empty());
  EXPECT_EQ(registry.find(make_id(1))->state, State::done);
}

TEST(Registry, prefixes_find_jobs_and_nothing_else_does) {
  const Folder folder;
  const store::Store store = store::Store::open(folder / "store");
  Registry registry = Registry::open(store, tests::be_silent);
  for (int n = 0; n < 40; ++n) submit(store, registry, n);
  EXPECT_EQ(registry.find_by_prefix(make_id(7).text().substr(0, 12)).size(), 1u);
  EXPECT_EQ(registry.find_by_prefix(make_id(7).text()).size(), 1u);
  for (const char* bad : {"", "%", "_", "'; drop table jobs; --", "../"}) EXPECT_TRUE(registry.find_by_prefix(bad).empty()) << bad;
  EXPECT_EQ(registry.list().size(), 40u);
}

TEST(Registry, is_brought_up_to_date_with_the_store) {
  const Folder folder;
  const store::Store store = store::Store::open(folder / "store");
  {
    Registry registry = Registry::open(store, tests::be_silent);
    for (int n = 0; n < 3; ++n) submit(store, registry, n);
  }
  tests::make_bank(store, make_submission(0));
  store.remove_work(make_id(0));
  tests::make_bank(store, make_submission(7));  // no row
  tests::make_work(store, make_submission(8));  // killed before the row
  store.remove_work(make_id(2));                // by hand
  const Registry registry = Registry::open(store, tests::be_silent);
  const auto state = [&](int n) { return to_text(registry.find(make_id(n))->state); };
  EXPECT_EQ(state(0) + state(1) + state(2) + state(7) + state(8), "donequeuedfaileddonequeued");
  EXPECT_NE(registry.find(make_id(2))->reason.find("submit the job again"), std::string::npos);
}

TEST(Registry, a_job_that_somebody_works_on_is_running_whatever_was_forgotten) {
  const Folder folder;
  const store::Store store = store::Store::open(folder / "store");
  tests::make_work(store, make_submission(1));
  outcome::Attempt attempt;
  attempt.token = store::make_random_name();
  attempt.process = process::find_self();
  attempt.started = outcome::find_utc();
  outcome::write_attempt(store.work_folder(make_id(1)), attempt);
  {
    const Registry registry = Registry::open(store, tests::be_silent);
    EXPECT_EQ(registry.find(make_id(1))->state, State::running);
    EXPECT_EQ(registry.find(make_id(1))->token, attempt.token);
  }
  attempt.process.start_ticks += 1;  // its number is somebody else's by now
  outcome::write_attempt(store.work_folder(make_id(1)), attempt);
  std::filesystem::remove(folder / "store/registry.sqlite");
  EXPECT_EQ(Registry::open(store, tests::be_silent).find(make_id(1))->state, State::queued);
}

TEST(Registry, hostile_names_stay_text) {
  const Folder folder;
  const store::Store store = store::Store::open(folder / "store");
  Registry registry = Registry::open(store, tests::be_silent);
  int number = 0;
  for (const std::string& name :
       {std::string("/a/'; drop table jobs; --"), std::string("/a/\"; rm -rf /\n.json"), std::string("/a/\x1b[2J"),
        "/a/" + std::string(4096, 'x'), std::string("/a/../../../x"), std::string("/a/\xe2\x80\xae.json")}) {
    registry::Submission submission = make_submission(++number);
    submission.job_file = submission.request.job_file = name;
    tests::make_work(store, submission);
    registry.submit({submission});
    EXPECT_EQ(registry.find_last_submission(name)->request.id, make_id(number).text());
  }
  std::filesystem::remove(folder / "store/registry.sqlite");
  const Registry again = Registry::open(store, tests::be_silent);
  EXPECT_EQ(again.list().size(), static_cast<std::size_t>(number));
  EXPECT_EQ(again.find_last_submission("/a/'; drop table jobs; --")->request.id, make_id(1).text());
}

}  // namespace
