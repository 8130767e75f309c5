// Cancel and retry of rows; signals to attempts.
#include "jobs/queue/settle.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>

#include "jobs/queue/local.hpp"
#include "jobs/store/identity.hpp"
#include "tests/unit/jobs/store/registry/jobs.hpp"

namespace carillon::tests {
namespace {

using registry::Job;
using registry::JobState;
using registry::Registry;

class Settle : public testing::Test {
 protected:
  Settle() : store_(store::Store::open(folder_ / "store")), registry_(Registry::open(store_, be_silent)) {
    make_work(store_, make_submission(1));
    registry_.submit({make_submission(1)});
  }

  void put(JobState state, int attempts, const std::string& reason) {
    registry_.update(make_id(1), [&](Job& job) { return job.state = state, job.attempts = attempts, job.reason = reason, true; });
  }

  std::string cancel(JobState state, int attempts, const std::string& reason) {
    put(state, attempts, reason);
    EXPECT_TRUE(queue::cancel(queue::LocalEnvironment(store_), registry_, make_id(1)).is_done);
    const Job job = *registry_.find(make_id(1));
    EXPECT_EQ(job.state, JobState::cancelled);
    return job.reason;
  }

  const Folder folder_;
  const store::Store store_;
  Registry registry_;
};

TEST_F(Settle, reason_of_a_cancelled_job) {
  EXPECT_EQ(cancel(JobState::queued, 0, ""), "cancelled before it ran");
  EXPECT_EQ(cancel(JobState::queued, 1, ""), "cancelled before it resumed");
  EXPECT_EQ(cancel(JobState::waiting, 2, "rank 1 was killed"), "cancelled while it waited: rank 1 was killed");
  EXPECT_EQ(cancel(JobState::failed, 4, "the mesh is bad"), "cancelled after it had failed: the mesh is bad");
}

TEST_F(Settle, retry_with_options_is_one_change) {
  // A job with a valid id, which retry checks.
  const job::JobSpec job = job::parse_job(
      R"({"body": {"shape": "bar", "length_m": 0.2, "width_m": 0.03, "thickness_m": 0.01, "nodes": 600},
          "material": {"young_modulus_pa": 70e9, "poisson_ratio": 0.33, "density_kg_m3": 2700, "damping": {"internal_friction": {"tan_phi": 1e-3}}}})",
      "bar.json", job::BankKey::optional);
  const store::Request request = store::RequestMaker("solver").make(job);
  const store::JobOrder order(job);
  store::prepare_work(store_, {{&order, &request}});
  registry_.submit({{"/jobs/bar.json", request}});
  const store::Id id = store::require_id(request.id, "test");
  registry_.update(id, [](Job& row) { return row.state = JobState::failed, row.attempts = 4, row.reason = "rank 1 was killed", true; });
  EXPECT_TRUE(queue::retry(store_, registry_, id, [](Job& row) { row.resources.ranks = 7; }).is_done);
  EXPECT_EQ(registry_.find(id)->state, JobState::queued);
  EXPECT_EQ(registry_.find(id)->resources.ranks, 7);
  EXPECT_FALSE(queue::retry(store_, registry_, id, [](Job& row) { row.resources.ranks = 9; }).is_done);
  EXPECT_EQ(registry_.find(id)->resources.ranks, 7);
}

TEST_F(Settle, job_with_the_folder_of_another_is_not_retried) {
  put(JobState::failed, 4, "rank 1 was killed");  // id without a request
  EXPECT_FALSE(queue::retry(store_, registry_, make_id(1)).is_done);
  EXPECT_EQ(registry_.find(make_id(1))->state, JobState::failed);
}

TEST_F(Settle, unrelated_process_gets_no_signal) {
  queue::LocalLauncher launcher(store_, {});
  Job job{make_id(1)};
  job.token = store::make_random_name();
  EXPECT_FALSE(launcher.is_attempt_of(job, process::find_self()));
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe(ends.data()), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    ::dup2(ends[0], 0);
    ::close(ends[1]);
    ::execlp("sh", "sh", "-c", "read line", job.token.c_str(), static_cast<char*>(nullptr));
    ::_exit(127);
  }
  const process::Identity found = *process::find_process(child);
  for (int round = 0; round < 10000 && !launcher.is_attempt_of(job, found); ++round) ::usleep(1000);  // wait for exec
  EXPECT_TRUE(launcher.is_attempt_of(job, found));
  Job other = job;
  other.token = store::make_random_name();
  EXPECT_FALSE(launcher.is_attempt_of(other, found));
  other.token = "sh";  // on its command line, but not a token
  EXPECT_FALSE(launcher.is_attempt_of(other, found));
  ::close(ends[0]);
  ::close(ends[1]);
  ::waitpid(child, nullptr, 0);
  EXPECT_FALSE(launcher.is_attempt_of(job, found));
}

}  // namespace
}  // namespace carillon::tests
