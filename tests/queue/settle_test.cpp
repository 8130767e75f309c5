// Cancel and retry of rows that nobody works on.
#include "jobs/queue/settle.hpp"

#include <gtest/gtest.h>

#include "tests/registry/jobs.hpp"

namespace carillon::tests {
namespace {

using registry::Job;
using registry::Registry;
using registry::State;

class Settle : public testing::Test {
 protected:
  Settle() : store_(store::Store::open(folder_ / "store")), registry_(Registry::open(store_, be_silent)) {
    make_work(store_, make_submission(1));
    registry_.submit({make_submission(1)});
  }

  void put(State state, int attempts, const std::string& reason) {
    registry_.update(make_id(1), [&](Job& job) { return job.state = state, job.attempts = attempts, job.reason = reason, true; });
  }

  std::string cancel(State state, int attempts, const std::string& reason) {
    put(state, attempts, reason);
    EXPECT_TRUE(queue::cancel(store_, registry_, make_id(1)).is_done);
    const Job job = *registry_.find(make_id(1));
    EXPECT_EQ(job.state, State::cancelled);
    return job.reason;
  }

  const Folder folder_;
  const store::Store store_;
  Registry registry_;
};

TEST_F(Settle, a_cancelled_job_says_what_it_was_and_why) {
  EXPECT_EQ(cancel(State::queued, 0, ""), "cancelled before it ran");
  EXPECT_EQ(cancel(State::queued, 1, ""), "cancelled before it went on");
  EXPECT_EQ(cancel(State::waiting, 2, "rank 1 was killed"), "cancelled while it waited: rank 1 was killed");
  EXPECT_EQ(cancel(State::failed, 4, "the mesh is bad"), "cancelled after it had failed: the mesh is bad");
}

TEST_F(Settle, a_retry_and_what_is_asked_with_it_are_one_change) {
  put(State::failed, 4, "rank 1 was killed");
  EXPECT_TRUE(queue::retry(store_, registry_, make_id(1), [](Job& job) { job.resources.ranks = 7; }).is_done);
  EXPECT_EQ(registry_.find(make_id(1))->state, State::queued);
  EXPECT_EQ(registry_.find(make_id(1))->resources.ranks, 7);
  EXPECT_FALSE(queue::retry(store_, registry_, make_id(1), [](Job& job) { job.resources.ranks = 9; }).is_done);
  EXPECT_EQ(registry_.find(make_id(1))->resources.ranks, 7);
}

}  // namespace
}  // namespace carillon::tests
