#include "runtime/synth/transfer_budget.hpp"

#include <gtest/gtest.h>

#include <numeric>
#include <vector>

namespace carillon::synth {
namespace {

TEST(TransferBudget, SharesAreNeedsPlusTheRest) {
  TransferBudget budget;
  budget.begin(1000.0, 4, 400);
  EXPECT_EQ(budget.find_share(0), 150);  // a quarter of the rest
  EXPECT_EQ(budget.find_share(300), 450);
}

TEST(TransferBudget, TogetherTheyNeverExceedFiveQuarters) {
  for (const int each : {0, 1, 10, 99, 100, 101, 500, 100000}) {
    for (const int bodies : {1, 7, 100}) {
      TransferBudget budget;
      std::vector<int> needs;
      for (int b = 0; b < bodies; ++b) needs.push_back(b % 3 == 0 ? 0 : each * (1 + b % 5));
      const std::int64_t all = std::accumulate(needs.begin(), needs.end(), std::int64_t{0});
      budget.begin(1000.0, bodies, all);
      std::int64_t shares = 0;
      for (const int need : needs) shares += budget.find_share(need);
      EXPECT_LE(shares, 1250) << each << " " << bodies;
      if (all >= 1000) {
        EXPECT_GE(shares, 1000) << each << " " << bodies;
      }
    }
  }
}

TEST(TransferBudget, NeedsDecay) {
  int need = TransferBudget::find_need(0, 456);
  EXPECT_EQ(need, 456);
  for (int block = 0; block < 16; ++block) need = TransferBudget::find_need(need, 0);
  EXPECT_GT(need, 100);
  for (int block = 0; block < 200; ++block) need = TransferBudget::find_need(need, 0);
  EXPECT_EQ(need, 0);
}

}  // namespace
}  // namespace carillon::synth
