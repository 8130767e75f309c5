// How attempts end: the cause, one true sentence, and what follows.
#include <gtest/gtest.h>
#include <stdlib.h>

#include <csignal>
#include <fstream>

#include "jobs/outcome/outcome.hpp"
#include "jobs/outcome/policy.hpp"

namespace {

namespace fs = std::filesystem;
using namespace carillon::outcome;

Verdict classify_code(int code, std::string_view log = "") {
  Ending ending;
  ending.exit_code = code;
  ending.log = log;
  return classify(ending);
}

constexpr std::string_view kMpirunKill =
    "--------------------------------------------------------------------------\n"
    "mpirun noticed that process rank 1 with PID 0 on node n1 exited on signal 9 (Killed).\n";

TEST(Endings, the_programs_own_last_error_line_is_the_reason) {
  const Verdict verdict = classify_code(
      2, "carillon-precompute: error: first.\nnoise\ncarillon-precompute: error: bar.msh:3: no node 7; correct it.\n--- mpirun says\n");
  EXPECT_EQ(verdict.cause, Cause::bad_input);
  EXPECT_EQ(verdict.reason, "bar.msh:3: no node 7; correct it");
  EXPECT_EQ(classify_code(3, "carillon-precompute: error: modes are missing\n").cause, Cause::no_solution);
}

TEST(Endings, a_reason_is_one_line_whatever_is_in_it) {
  const std::string log = "carillon-precompute: error: a\x1b[31m\rb\tc " + std::string(5000, 'x') + "\n";
  const std::string reason = classify_code(2, log).reason;
  EXPECT_LE(reason.size(), 1000u);
  for (const char letter : reason) EXPECT_GE(static_cast<unsigned char>(letter), 0x20);
}

TEST(Endings, a_killed_rank_is_named) {
  const Verdict verdict = classify_code(137, kMpirunKill);
  EXPECT_EQ(verdict.cause, Cause::killed);
  EXPECT_EQ(verdict.reason, "rank 1 on n1 was killed by signal 9 (Killed)");
  EXPECT_EQ(classify_code(143).cause, Cause::killed);
  EXPECT_EQ(classify_code(139).cause, Cause::crashed);
  EXPECT_EQ(classify_code(134).cause, Cause::crashed);
  EXPECT_EQ(classify_code(205).cause, Cause::node_lost);
  EXPECT_EQ(classify_code(1).cause, Cause::node_lost);
}

TEST(Endings, a_kill_while_the_kernel_was_out_of_memory_is_for_memory) {
  Ending ending;
  ending.exit_code = 137;
  ending.was_kernel_out_of_memory = true;
  EXPECT_EQ(classify(ending).cause, Cause::memory);
  ending.exit_code = 143;
  EXPECT_EQ(classify(ending).cause, Cause::killed);
}

TEST(Endings, the_need_in_gb_is_read_from_what_the_program_says) {
  const Verdict factor = classify_code(
      4, "carillon-precompute: error: Out of memory: L D L^T of K - sigma M needs 3.250 GB, 1.600 GB on the fullest of 2 ranks.\n");
  EXPECT_EQ(factor.cause, Cause::memory);
  EXPECT_DOUBLE_EQ(factor.memory_need_gb, 3.25);
  const Verdict check = classify_code(4,
                                      "carillon-precompute: error: the solve needs about 12.50 GB on vm (2 ranks; 12.50 GB on all "
                                      "machines), and 8.00 GB are left there.\n");
  EXPECT_DOUBLE_EQ(check.memory_need_gb, 12.5);
  EXPECT_EQ(classify_code(4, "carillon-precompute: error: it needs 3 GBs of patience\n").memory_need_gb, 0.0);
  EXPECT_EQ(classify_code(4, "carillon-precompute: error: needs 5").memory_need_gb, 0.0);
}

TEST(Endings, a_full_disk_is_told_from_other_refusals) {
  EXPECT_EQ(classify_code(4, "carillon-precompute: error: bank.hdf: cannot write: No space left on device; check\n").cause,
            Cause::disk_full);
  EXPECT_EQ(classify_code(4, "carillon-precompute: error: bank.hdf: cannot write: Permission denied; check\n").cause, Cause::system);
  Ending crash;
  crash.exit_code = 135;
  crash.is_disk_full = true;
  EXPECT_EQ(classify(crash).cause, Cause::disk_full);
  Ending bad;
  bad.exit_code = 2;
  bad.log = "carillon-precompute: error: mesh of No space left on device: bad\n";
  EXPECT_EQ(classify(bad).cause, Cause::bad_input);
}

TEST(Endings, what_we_did_explains_the_code) {
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
  // Whoever was asked to stop and ends with an error of its own has that error.
  ending = {};
  ending.exit_code = 2;
  ending.was_asked_to_stop = true;
  ending.log = "carillon-precompute: error: bad mesh\n";
  EXPECT_EQ(classify(ending).cause, Cause::bad_input);
  // And whoever was done before it heard of it is done.
  ending.exit_code = 0;
  EXPECT_EQ(classify(ending).cause, Cause::done);
}

TEST(Endings, causes_that_cannot_pass_are_not_tried_again) {
  for (const Cause cause : {Cause::bad_input, Cause::no_solution, Cause::no_program}) EXPECT_EQ(decide(cause, 0, false).next, Next::failed);
}

TEST(Endings, causes_that_can_pass_are_tried_again_after_10_40_and_160_seconds) {
  for (const Cause cause :
       {Cause::killed, Cause::crashed, Cause::node_lost, Cause::hung, Cause::system, Cause::bad_bank, Cause::memory, Cause::time_limit}) {
    int failures = 0;
    for (const double delay_s : {10.0, 40.0, 160.0}) {
      const Decision decision = decide(cause, failures, false);
      EXPECT_EQ(decision.next, Next::wait);
      EXPECT_DOUBLE_EQ(decision.delay_s, delay_s);
      EXPECT_EQ(decision.failures, ++failures);
    }
    EXPECT_EQ(decide(cause, failures, false).next, Next::failed);
  }
}

TEST(Endings, saved_progress_starts_the_count_anew) {
  const Decision decision = decide(Cause::killed, kMostRetries, true);
  EXPECT_EQ(decision.next, Next::wait);
  EXPECT_EQ(decision.failures, 1);
  EXPECT_EQ(decide(Cause::time_limit, kMostRetries, true).next, Next::queue);
}

TEST(Endings, stops_do_not_count_and_a_full_disk_is_waited_for) {
  EXPECT_EQ(decide(Cause::stopped, 2, false).next, Next::queue);
  EXPECT_EQ(decide(Cause::stopped, 2, false).failures, 2);
  EXPECT_EQ(decide(Cause::checkpointed, 0, false).next, Next::queue);
  for (const int failures : {0, 3, 100}) {
    EXPECT_EQ(decide(Cause::disk_full, failures, false).next, Next::wait);
    EXPECT_EQ(decide(Cause::disk_full, failures, false).failures, failures);
  }
}

TEST(Endings, after_a_lack_of_memory_more_is_asked_for) {
  EXPECT_GT(calc_next_memory(4.0, 1.0), 4.0);
  EXPECT_GT(calc_next_memory(0.0, 2.0), 2.0);
}

class Files : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "carillon-outcome-XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
  }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path folder_;
};

TEST_F(Files, what_is_written_is_read_back) {
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

TEST_F(Files, a_file_that_was_cut_anywhere_is_no_file) {
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

TEST(Endings, every_cause_has_a_word_of_its_own) {
  for (int i = 0; i <= static_cast<int>(Cause::predicted); ++i) {
    const Cause cause = static_cast<Cause>(i);
    EXPECT_EQ(find_cause(to_text(cause)), cause);
  }
  EXPECT_FALSE(find_cause("nonsense"));
}

}  // namespace
