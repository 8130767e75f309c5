// Outcome of a job from Slurm status and attempt files.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "jobs/queue/slurm/engine.hpp"
#include "jobs/queue/slurm/inside.hpp"
#include "jobs/queue/slurm/task.hpp"
#include "tests/support/folder.hpp"

namespace carillon::slurm {
namespace {

namespace fs = std::filesystem;
using outcome::Cause;

class slurm_judge : public ::testing::Test {
 protected:
  slurm_judge() {
    store_.emplace(store::Store::open(folder_));
    fs::create_directories(store_->work_folder(id_));
  }

  SlurmOutcome judge(const std::string& state, int exit_code = 0, int signal = 0) const {
    SlurmStatus seen;
    seen.phase = SlurmPhase::ended;
    seen.state = state;
    seen.exit_code = exit_code;
    seen.signal = signal;
    return slurm::judge(*store_, id_, handed_, seen);
  }

  void leave(const std::string& attempt_token, const std::string& outcome_token, Cause cause) const {
    outcome::Attempt attempt;
    attempt.process = process::find_self();
    attempt.started = outcome::find_utc();
    attempt.token = attempt_token;
    outcome::write_attempt(store_->work_folder(id_), attempt);
    outcome::Outcome outcome;
    outcome.token = outcome_token;
    outcome.cause = cause;
    outcome.reason = "its own word";
    outcome.host = process::find_host();
    outcome.started = outcome.ended = outcome::find_utc();
    outcome::write_outcome(store_->work_folder(id_), outcome);
  }

  void write_output(const std::string& text) const {
    fs::create_directories(folder_ / "slurm" / handed_.batch);
    std::ofstream(make_output_file(folder_, handed_.batch, 0)) << text;
  }

  const store::Id id_ = store::hash_text("a job");
  const SubmittedJob handed_{std::string(32, 'a'), "carillon-0", -1, "token before"};
  const tests::Folder scratch_;
  const fs::path& folder_ = scratch_.path();
  std::optional<store::Store> store_;
};

TEST_F(slurm_judge, the_word_of_the_last_attempt_counts) {
  leave("new", "new", Cause::no_solution);
  EXPECT_EQ(judge("FAILED", 3).outcome.cause, Cause::no_solution);
  EXPECT_EQ(judge("FAILED", 3).outcome.reason, "its own word");
}

TEST_F(slurm_judge, the_word_of_an_earlier_attempt_does_not) {
  leave("token before", "token before", Cause::no_solution);
  EXPECT_EQ(judge("NODE_FAIL").outcome.cause, Cause::node_lost);
  leave("new", "token before", Cause::no_solution);
  EXPECT_EQ(judge("TIMEOUT").outcome.cause, Cause::time_limit);
}

TEST_F(slurm_judge, lack_of_memory_is_recognised_by_state_and_by_message) {
  EXPECT_EQ(judge("OUT_OF_MEMORY", 0, 125).outcome.cause, Cause::memory);
  EXPECT_EQ(judge("FAILED", 0, 9).outcome.cause, Cause::killed);
  write_output("slurmstepd: error: Step 7.4294967291 exceeded memory limit (2040109465 > 104857600), being killed\n");
  const SlurmOutcome judgement = judge("FAILED", 0, 9);
  EXPECT_EQ(judgement.outcome.cause, Cause::memory);
  EXPECT_NE(judgement.outcome.reason.find("exceeded memory limit (2040109465 > 104857600)"), std::string::npos) << judgement.outcome.reason;
}

TEST_F(slurm_judge, cancelled_and_forgotten_jobs_are_distinguished) {
  EXPECT_TRUE(judge("CANCELLED", 0, 15).is_cancelled);
  EXPECT_FALSE(judge("FAILED").is_cancelled);
  const SlurmOutcome forgotten = slurm::judge(*store_, id_, handed_, std::nullopt);
  EXPECT_FALSE(forgotten.is_cancelled);
  EXPECT_EQ(forgotten.outcome.cause, Cause::killed);
  EXPECT_NE(forgotten.outcome.reason.find("no longer knows"), std::string::npos);
}

TEST_F(slurm_judge, what_was_handed_over_is_known_again) {
  const fs::path work = store_->work_folder(id_);
  EXPECT_FALSE(read_submitted_job(work));
  for (const std::string& before : std::vector<std::string>{"", "0123"}) {
    write_submitted_job(work, {std::string(32, 'b'), "carillon-1", 7, before});
    const auto submitted = read_submitted_job(work);
    ASSERT_TRUE(submitted);
    EXPECT_EQ(submitted->batch, std::string(32, 'b'));
    EXPECT_EQ(submitted->title, "carillon-1");
    EXPECT_EQ(submitted->task, 7);
    EXPECT_EQ(submitted->before, before);
  }
  remove_submitted_job(work);
  EXPECT_FALSE(read_submitted_job(work));
  EXPECT_EQ(read_failures(work), 0);
  write_failures(work, 3);
  EXPECT_EQ(read_failures(work), 3);
}

TEST_F(slurm_judge, a_packed_job_and_the_list_of_its_task_are_known_again) {
  const fs::path work = store_->work_folder(id_);
  SubmittedJob packed{std::string(32, 'c'), "carillon-2", 3, "", 41, true};
  write_submitted_job(work, packed);
  EXPECT_EQ(read_submitted_job(work)->place, 41);
  EXPECT_TRUE(read_submitted_job(work)->is_unwanted);
  const store::Id other = store::hash_text("another job");
  make_batch_folder(*store_, packed.batch, "", {id_, other},
                    {{}, {64, 120.5, {{other, {0, 4, 2.5, 31.25}, 90.0}, {id_, {1, 1, 0.25, 0.125}, 0.0}}}});
  const std::optional<TaskList> list = read_task(folder_, packed.batch, 1);
  ASSERT_TRUE(list);
  EXPECT_EQ(list->cores, 64);
  EXPECT_DOUBLE_EQ(list->memory_gb, 120.5);
  ASSERT_EQ(list->jobs.size(), 2u);
  EXPECT_EQ(list->jobs[0].id, other);
  EXPECT_EQ(list->jobs[0].placed.ranks, 4);
  EXPECT_DOUBLE_EQ(list->jobs[0].placed.memory_gb, 2.5);
  EXPECT_DOUBLE_EQ(list->jobs[0].time_limit_s, 90.0);
  EXPECT_EQ(list->jobs[1].placed.job, 1u);
  EXPECT_DOUBLE_EQ(list->jobs[1].placed.seconds, 0.125);
  EXPECT_FALSE(read_task(folder_, packed.batch, 2));
  EXPECT_FALSE(read_task(folder_, "../" + packed.batch, 1));
  packed.task = 1;
  EXPECT_FALSE(has_begun(folder_, packed));
  write_begun(folder_, packed.batch, 1);
  EXPECT_TRUE(has_begun(folder_, packed));
}

TEST_F(slurm_judge, where_a_packed_job_stands_is_in_its_folder) {
  EXPECT_EQ(find_packed_state(*store_, id_, handed_), PackedState::waits);
  leave("token before", "token before", Cause::killed);
  EXPECT_EQ(find_packed_state(*store_, id_, handed_), PackedState::waits);
  leave("new", "token before", Cause::killed);
  EXPECT_EQ(find_packed_state(*store_, id_, handed_), PackedState::runs);
  leave("new", "new", Cause::stopped);
  EXPECT_EQ(find_packed_state(*store_, id_, handed_), PackedState::stopped);
  leave("new", "new", Cause::no_solution);
  EXPECT_EQ(find_packed_state(*store_, id_, handed_), PackedState::ended);
}

TEST_F(slurm_judge, a_script_that_cannot_start_carillon_says_so) {
  write_output("/var/spool/job00012/slurm_script: 8: exec: /opt/carillon: not found\n");
  const SlurmOutcome judgement = judge("FAILED", 127);
  EXPECT_EQ(judgement.outcome.cause, Cause::no_program);
  EXPECT_NE(judgement.outcome.reason.find("/opt/carillon: not found"), std::string::npos) << judgement.outcome.reason;
}

TEST(slurm_inside, who_stops_an_attempt_inside_is_the_time_limit) {
  outcome::Outcome stopped;
  stopped.cause = Cause::stopped;
  stopped.is_further = true;
  stopped.percent = 41.6;
  EXPECT_EQ(explain_stop(stopped).cause, Cause::time_limit);
  EXPECT_NE(explain_stop(stopped).reason.find("42 %"), std::string::npos);
  stopped.cause = Cause::killed;
  EXPECT_EQ(explain_stop(stopped).cause, Cause::killed);
}

}  // namespace
}  // namespace carillon::slurm
