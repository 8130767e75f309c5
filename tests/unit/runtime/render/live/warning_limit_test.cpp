#include "runtime/render/live/warning_limit.hpp"

#include <gtest/gtest.h>

namespace carillon::live {
namespace {

TEST(WarningLimit, AFloodIsCountedAndThenWarningsAreHeardAgain) {
  WarningLimit limit;
  int printed = 0;
  for (int n = 0; n < 100000; ++n) printed += limit.pass(5.0 + 1e-5 * n) >= 0 ? 1 : 0;
  EXPECT_EQ(printed, 10);
  EXPECT_EQ(limit.pass(6.1), 100000 - 10);
  EXPECT_EQ(limit.pass(6.2), -1);
  EXPECT_EQ(limit.pass(60.0), 1);
  for (int n = 0; n < 9; ++n) EXPECT_EQ(limit.pass(60.0), 0) << n;
  EXPECT_EQ(limit.pass(60.0), -1);
}

}  // namespace
}  // namespace carillon::live
