// Rows of the engine "slurm" that need no question to Slurm.
#include "jobs/slurm/engine.hpp"

#include <gtest/gtest.h>

#include "tests/unit/jobs/registry/jobs.hpp"

namespace carillon::tests {
namespace {

using registry::Job;
using registry::JobState;
using registry::Registry;

class Engine : public testing::Test {
 protected:
  Engine() : store_(store::Store::open(folder_ / "store")), registry_(Registry::open(store_, be_silent)) {
    registry::Submission submission = make_submission(1);
    submission.request.engine = store::JobEngine::slurm;
    make_work(store_, submission);
    registry_.submit({submission});
  }

  /// The row after `worker` claimed it and the engine looked at it.
  JobState follow(const process::Identity& worker) {
    const auto all = [](const std::vector<Job>&, const std::vector<Job>& ready) { return ready; };
    EXPECT_EQ(registry_.claim(store::JobEngine::slurm, worker, all).size(), 1u);
    slurm::Engine(store_, {}, "carillon", be_silent).follow(registry_);
    return registry_.find(make_id(1))->state;
  }

  const Folder folder_;
  const store::Store store_;
  Registry registry_;
};

TEST_F(Engine, a_claim_of_this_process_that_handed_nothing_over_is_queued_again) {
  EXPECT_EQ(follow(process::find_self()), JobState::queued);
}

TEST_F(Engine, a_claim_of_another_machine_is_not_ours_for_having_our_number) {
  process::Identity other = process::find_self();
  other.host = "another-host";
  other.boot = "another-boot:1";
  EXPECT_EQ(follow(other), JobState::running);
}

TEST_F(Engine, a_job_that_waits_after_a_failure_keeps_why_when_it_is_cancelled) {
  registry_.update(make_id(1), [](Job& job) { return job.state = JobState::waiting, job.attempts = 2, job.reason = "node n7 died", true; });
  EXPECT_TRUE(slurm::Engine(store_, {}, "carillon", be_silent).cancel(registry_, make_id(1)));
  EXPECT_EQ(registry_.find(make_id(1))->reason, "cancelled while it waited: node n7 died");
}

}  // namespace
}  // namespace carillon::tests
