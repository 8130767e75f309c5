// How attempts end: the cause, one true sentence, and what follows.
#include <gtest/gtest.h>
#include <stdlib.h>

#include <csignal>
#include <fstream>

#include "jobs/store/outcome/outcome.hpp"
#include "jobs/store/outcome/policy.hpp"
#include "tests/support/folder.hpp"

namespace {

namespace fs = std::filesystem;
using namespace carillon::outcome;
namespace base = carillon::base;

/// An ending with the result that the solver left.
FailureCause classify_result(base::ResultKind kind, const std::string& message, double need_bytes = 0.0) {
  Ending ending;
  ending.exit_code = base::get_exit_code(kind);
  ending.result = base::Result{kind, message, "", need_bytes, false};
  return classify(ending);
}

/// One without.
FailureCause classify_code(int code, const std::string& dead_rank = "") {
  Ending ending;
  ending.exit_code = code;
  ending.dead_rank = dead_rank;
  return classify(ending);
}

TEST(Endings, result_of_the_solver_takes_precedence) {
  const FailureCause found = classify_result(base::ResultKind::bad_input, "bar.msh:3: no node 7; correct it.");
  EXPECT_EQ(found.cause, Cause::bad_input);
  EXPECT_EQ(found.reason, "bar.msh:3: no node 7; correct it");
  EXPECT_EQ(classify_result(base::ResultKind::no_solution, "modes are missing").cause, Cause::no_solution);
  EXPECT_EQ(classify_result(base::ResultKind::disk_full, "bank.hdf: no room").cause, Cause::disk_full);
  EXPECT_EQ(classify_result(base::ResultKind::system, "No space left on device").cause, Cause::system);  // words decide nothing
  EXPECT_EQ(classify_result(base::ResultKind::done, "").cause, Cause::done);
}

TEST(Endings, reason_is_one_line) {
  const std::string reason = classify_result(base::ResultKind::bad_input, "a\x1b[31m\rb\tc " + std::string(5000, 'x')).reason;
  EXPECT_LE(reason.size(), 1000u);
  for (const char letter : reason) EXPECT_GE(static_cast<unsigned char>(letter), 0x20);
}

TEST(Endings, without_a_result_signals_and_exit_codes_are_classified) {
  const FailureCause killed = classify_code(137, "rank 1 on n1");
  EXPECT_EQ(killed.cause, Cause::killed);
  EXPECT_EQ(killed.reason, "rank 1 on n1 was killed by signal 9 (Killed)");
  EXPECT_EQ(classify_code(137).reason, "the solver was killed by signal 9 (Killed)");
  EXPECT_EQ(classify_code(143).cause, Cause::killed);
  EXPECT_EQ(classify_code(139).cause, Cause::crashed);
  EXPECT_EQ(classify_code(134).cause, Cause::crashed);
  EXPECT_EQ(classify_code(205).cause, Cause::node_lost);
  EXPECT_EQ(classify_code(1).cause, Cause::node_lost);
  EXPECT_EQ(classify_code(2).cause, Cause::bad_input);
  EXPECT_EQ(classify_code(3).cause, Cause::no_solution);
}

TEST(Endings, kill_by_the_kernel_is_for_memory) {
  EXPECT_EQ(classify({.exit_code = 137, .was_kernel_out_of_memory = true}).cause, Cause::memory);
  EXPECT_EQ(classify({.exit_code = 143, .was_kernel_out_of_memory = true}).cause, Cause::killed);
}

TEST(Endings, memory_need_is_that_of_the_result) {
  const FailureCause found = classify_result(base::ResultKind::memory, "the solve needs about 12.50 GB", 12.5e9);
  EXPECT_EQ(found.cause, Cause::memory);
  EXPECT_DOUBLE_EQ(found.memory_need_gb, 12.5);
}

TEST(Endings, exceeding_memory_gb_is_permanent) {
  Ending ending{.exit_code = 4, .result = base::Result{.kind = base::ResultKind::memory, .message = "it needs much", .need_bytes = 12.5e9}};
  ending.memory_limit_gb = 16.0;  // the machine has less
  EXPECT_EQ(classify(ending).cause, Cause::memory);
  ending.memory_limit_gb = 8.0;
  EXPECT_EQ(classify(ending).cause, Cause::memory_limit);
  EXPECT_NE(classify(ending).reason.find("\"memory_gb\" of the job is 8, and it needs at least 12"), std::string::npos)
      << classify(ending).reason;
  ending = {.exit_code = 137};
  ending.memory_limit_gb = 8.0;
  ending.held_gb = 8.25;
  EXPECT_EQ(classify(ending).cause, Cause::memory_limit);
  EXPECT_EQ(decide(Cause::memory_limit, 0, true).next, Next::failed);
}

TEST(Endings, a_full_disk_explains_a_crash) {
  EXPECT_EQ(classify({.exit_code = 135, .is_disk_full = true}).cause, Cause::disk_full);
  EXPECT_EQ(classify({.exit_code = 3, .is_disk_full = true}).cause, Cause::no_solution);
}

TEST(Endings, own_actions_explain_the_code) {
  Ending ending;
  ending.exit_code = 137;
  ending.was_hung = true;
  ending.hang_s = 600.0;
  EXPECT_EQ(classify(ending).cause, Cause::hung);
  ending = {};
  ending.exit_code = 85;
  ending.was_asked_to_stop = true;
  EXPECT_EQ(classify(ending).cause, Cause::stopped);
  ending.was_asked_to_stop = false;
  EXPECT_EQ(classify(ending).cause, Cause::checkpointed);
  ending.was_out_of_time = true;
  EXPECT_EQ(classify(ending).cause, Cause::time_limit);
  // A process that was asked to stop and ends with an error of its own has that error.
  ending = {};
  ending.exit_code = 2;
  ending.was_asked_to_stop = true;
  ending.result = base::Result{base::ResultKind::bad_input, "bad mesh"};
  EXPECT_EQ(classify(ending).cause, Cause::bad_input);
  // And one that was done before the request arrived is done.
  ending.exit_code = 0;
  EXPECT_EQ(classify(ending).cause, Cause::done);
}

TEST(Endings, reason_of_a_time_limit) {
  Ending ending;
  ending.exit_code = 137;
  ending.was_out_of_time = true;
  EXPECT_EQ(classify(ending).reason, "time limit reached; nothing was saved");
  ending.has_saved = true;
  EXPECT_EQ(classify(ending).reason, "time limit reached; resumes from the last checkpoint");
  ending.exit_code = 85;
  EXPECT_EQ(classify(ending).reason, "time limit reached; saved, and resumes from there");
}

TEST(Endings, permanent_causes_are_not_retried) {
  for (const Cause cause : {Cause::bad_input, Cause::no_solution, Cause::no_program}) EXPECT_EQ(decide(cause, 0, false).next, Next::failed);
}

TEST(Endings, transient_causes_are_retried_after_10_40_and_160_seconds) {
  for (const Cause cause :
       {Cause::killed, Cause::crashed, Cause::node_lost, Cause::hung, Cause::system, Cause::bad_bank, Cause::memory, Cause::time_limit}) {
    int failures = 0;
    for (const double delay_s : {10.0, 40.0, 160.0}) {
      const RetryDecision decision = decide(cause, failures, false);
      EXPECT_EQ(decision.next, Next::wait);
      EXPECT_DOUBLE_EQ(decision.delay_s, delay_s);
      EXPECT_EQ(decision.failures, ++failures);
    }
    EXPECT_EQ(decide(cause, failures, false).next, Next::failed);
  }
}

TEST(Endings, saved_progress_resets_the_count) {
  const RetryDecision decision = decide(Cause::killed, kMaxRetries, true);
  EXPECT_EQ(decision.next, Next::wait);
  EXPECT_EQ(decision.failures, 1);
  EXPECT_EQ(decide(Cause::time_limit, kMaxRetries, true).next, Next::queue);
}

TEST(Endings, stops_and_full_disks_do_not_count) {
  EXPECT_EQ(decide(Cause::stopped, 2, false).next, Next::queue);
  EXPECT_EQ(decide(Cause::stopped, 2, false).failures, 2);
  EXPECT_EQ(decide(Cause::checkpointed, 0, false).next, Next::queue);
  for (const int failures : {0, 3, 100}) {
    EXPECT_EQ(decide(Cause::disk_full, failures, false).next, Next::wait);
    EXPECT_EQ(decide(Cause::disk_full, failures, false).failures, failures);
  }
}

TEST(Endings, memory_is_raised_after_running_out) {
  EXPECT_GT(calc_next_memory(4.0, 1.0), 4.0);
  EXPECT_GT(calc_next_memory(0.0, 2.0), 2.0);
}

class Files : public testing::Test {
 protected:
  const carillon::tests::Folder scratch_;
  const fs::path& folder_ = scratch_.path();
};

TEST_F(Files, round_trip) {
  Outcome out;
  out.token = "0123456789abcdef0123456789abcdef";
  out.cause = Cause::node_lost;
  out.reason = "a \"quoted\"\nline, \\ and \xc3\xa9";
  out.exit_code = 205;
  out.ranks = 7;
  out.percent = 12.5;
  out.is_further = true;
  out.host = "a host";
  out.started = out.ended = find_utc();
  write_outcome(folder_, out);
  const std::optional<Outcome> in = read_outcome(folder_);
  ASSERT_TRUE(in);
  EXPECT_EQ(in->token, out.token);
  EXPECT_EQ(in->cause, out.cause);
  EXPECT_EQ(in->reason, out.reason);
  EXPECT_EQ(in->exit_code, 205);
  EXPECT_EQ(in->ranks, 7);
  EXPECT_EQ(in->percent, 12.5);
  EXPECT_TRUE(in->is_further);
  const Attempt attempt{out.token, carillon::process::find_self(), 3, 1.5, find_utc()};
  write_attempt(folder_, attempt);
  const std::optional<Attempt> read = read_attempt(folder_);
  ASSERT_TRUE(read);
  EXPECT_EQ(carillon::process::find_life(read->process), carillon::process::Life::running);
}

TEST_F(Files, truncated_file_is_ignored) {
  Outcome out;
  out.reason = "some reason";
  out.host = out.token = out.started = out.ended = "x";
  write_outcome(folder_, out);
  std::ifstream stream(folder_ / "outcome.json");
  const std::string text{std::istreambuf_iterator<char>(stream), {}};
  for (std::size_t length = 0; length + 2 < text.size(); ++length) {
    std::ofstream(folder_ / "outcome.json") << text.substr(0, length);
    EXPECT_FALSE(read_outcome(folder_)) << length;
  }
}

TEST(Endings, every_cause_has_its_own_word) {
  for (int i = 0; i <= static_cast<int>(Cause::predicted); ++i) {
    const Cause cause = static_cast<Cause>(i);
    EXPECT_EQ(find_cause(to_text(cause)), cause);
  }
  EXPECT_FALSE(find_cause("nonsense"));
}

}  // namespace
