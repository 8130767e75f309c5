// The progress file of a run: phases, modes found of those counted, a percentage that never decreases.
#include "precompute/run/progress.hpp"

#include <gtest/gtest.h>

#include <sstream>
#include <string>
#include <vector>

#include "runtime/base/file.hpp"
#include "runtime/base/json.hpp"
#include "runtime/base/temporary.hpp"

namespace carillon::run {
namespace {

std::vector<base::Json> read_lines(const std::filesystem::path& file) {
  std::istringstream stream(base::read_file(file, "progress", 1 << 20));
  std::vector<base::Json> lines;
  for (std::string line; std::getline(stream, line);) {
    lines.push_back(base::Json::parse(line).value());
  }
  return lines;
}

void solve(ProgressReporter& progress, std::int64_t modes) {
  for (const char* phase : {"read", "partition", "assemble", "modes"}) progress.begin(phase);
  progress.advance({.phase = eigen::Phase::kFactor});
  for (std::int64_t solves = 0; solves < 1000; solves += 100)
    progress.advance({eigen::Phase::kIterate, solves / 100, modes, 0, 0, 3, solves});
  progress.advance({eigen::Phase::kCheck, modes + 2, modes, 0, 0, 3, 1000});
  progress.begin("errors");
}

TEST(ProgressReporter, never_decreases_and_ends_at_100_after_any_number_of_trials) {
  const base::TemporaryFolder folder("carillon-test-");
  for (const int trials : {1, 2, 9}) {
    const std::filesystem::path file = folder.path() / std::to_string(trials);
    ProgressReporter progress(file);
    for (int trial = 0; trial < trials; ++trial) solve(progress, 20);
    for (const char* phase : {"coupling", "collect", "air", "write"}) progress.begin(phase);
    progress.finish();
    const std::vector<base::Json> lines = read_lines(file);
    double before = 0.0;
    for (std::size_t i = 0; i + 1 < lines.size(); ++i) {
      EXPECT_GE(lines[i]["percent"].as_double(), before) << trials << " " << i;
      EXPECT_LT(lines[i]["percent"].as_double(), 100.0) << trials << " " << i;
      EXPECT_LE(lines[i]["modes_done"].as_double(), lines[i]["modes_wanted"].as_double()) << trials << " " << i;
      before = lines[i]["percent"].as_double();
    }
    EXPECT_EQ(lines.back()["phase"].as_string(), "done");
    EXPECT_EQ(lines.back()["percent"].as_double(), 100.0);
    EXPECT_EQ(lines.back()["modes_done"].as_double(), 20);
    EXPECT_EQ(lines.back()["modes_wanted"].as_double(), 20);
  }
}

TEST(ProgressReporter, a_step_of_the_search_moves_the_percentage_before_any_mode_is_found) {
  const base::TemporaryFolder folder("carillon-test-");
  ProgressReporter progress(folder.path() / "p");
  progress.begin("assemble");
  progress.advance({eigen::Phase::kIterate, 0, 100, 0, 0, 3, 16});
  progress.advance({eigen::Phase::kIterate, 0, 100, 0, 0, 3, 32});
  const std::vector<base::Json> lines = read_lines(folder.path() / "p");
  ASSERT_EQ(lines.size(), 3u);
  EXPECT_FALSE(lines[0].has("modes_wanted"));
  EXPECT_LT(lines[1]["percent"].as_double(), lines[2]["percent"].as_double());
}

TEST(Describe, a_step_of_the_eigensolver) {
  EXPECT_EQ(describe({eigen::Phase::kIterate, 24, 228}), "24 of 228 modes");
  EXPECT_EQ(describe({eigen::Phase::kIterate, 230, 228}), "228 of 228 modes");
  EXPECT_EQ(describe({.phase = eigen::Phase::kFactor}), "factorising K - sigma M");
}

}  // namespace
}  // namespace carillon::run
