#include "runtime/base/instructions.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

#include "runtime/base/command.hpp"

namespace carillon::base {
namespace {

/// Result of another process with this environment.
int find_with(const std::string& entry) {
  const Finished finished =
      run({.words = {find_self(), "--gtest_filter=Instructions.DISABLED_are_printed", "--gtest_also_run_disabled_tests"},
           .environment = std::vector<std::string>{entry},
           .output = kCapture});
  const std::size_t at = finished.output.find("found: ");
  return at == std::string::npos ? -1 : finished.output[at + 7] - '0';
}

TEST(Instructions, DISABLED_are_printed) { std::printf("found: %d\n", static_cast<int>(find_instructions())); }

TEST(Instructions, are_limited_by_the_environment) {
  const int best = find_with("NOTHING=1");
  ASSERT_GE(best, 0);
  EXPECT_EQ(find_with("CARILLON_INSTRUCTIONS=plain"), static_cast<int>(Instructions::kPlain));
  EXPECT_EQ(find_with("CARILLON_INSTRUCTIONS=avx2"), std::min(best, static_cast<int>(Instructions::kAvx2)));
  EXPECT_EQ(find_with("CARILLON_INSTRUCTIONS=avx512"), best);
}

TEST(Instructions, are_listed_ascending) {
  const std::vector<Instructions> sets = list_instructions();
  ASSERT_FALSE(sets.empty());
  EXPECT_EQ(sets.front(), Instructions::kPlain);
  EXPECT_TRUE(std::is_sorted(sets.begin(), sets.end()));
  EXPECT_EQ(sets.back(), find_instructions());
}

}  // namespace
}  // namespace carillon::base
