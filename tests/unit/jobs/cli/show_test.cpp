// Formats for display.
#include <gtest/gtest.h>

#include "jobs/cli/follow.hpp"
#include "jobs/cli/shared.hpp"

namespace carillon::cli {
namespace {

TEST(Show, escapes_and_truncates_at_a_character) {
  EXPECT_EQ(show("a\x1b[31m"), "a\\u001b[31m");
  EXPECT_EQ(show("\xff"), "\\xff");
  EXPECT_EQ(show("\xc3\xa4\xc3\xa4\xc3\xa4", 3), "\xc3\xa4\xc3\xa4...");
}

TEST(Show, numbers) {
  EXPECT_EQ(format_seconds(12.4), "12 s");
  EXPECT_EQ(format_seconds(75), "1 min 15 s");
  EXPECT_EQ(format_seconds(3840), "1 h 04 min");
  EXPECT_EQ(format_seconds(-1), "?");
  EXPECT_EQ(format_bytes(999), "999 B");
  EXPECT_EQ(format_bytes(1.25e9), "1.2 GB");
  EXPECT_EQ(to_json_time(0).is_null(), true);
  EXPECT_EQ(to_json_time(1e9).as_string(), "2001-09-09T01:46:40Z");
}

TEST(Follow, exit_code) {
  const auto make = [](std::vector<registry::JobState> states) {
    std::vector<registry::Job> jobs;
    for (const registry::JobState state : states) jobs.push_back({.id = store::hash_text("a"), .state = state});
    return find_exit_code(jobs);
  };
  EXPECT_EQ(make({}), 0);
  EXPECT_EQ(make({registry::JobState::done, registry::JobState::running}), kExitNotYet);
  EXPECT_EQ(make({registry::JobState::running, registry::JobState::cancelled}), kExitSolve);
}

TEST(Submit, jobs_that_are_requeued) {
  registry::Job job{.id = store::hash_text("a"), .state = registry::JobState::failed};
  job.attempts = 1;
  EXPECT_FALSE(is_submitted_again(job, true));
  EXPECT_TRUE(is_submitted_again(job, false));
  job.attempts = 0;
  EXPECT_TRUE(is_submitted_again(job, true));
  job.state = registry::JobState::cancelled;
  EXPECT_TRUE(is_submitted_again(job, true));
}

}  // namespace
}  // namespace carillon::cli
