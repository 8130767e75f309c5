// Struck modes against carillon-bank info.
#include "jobs/front/hear/strikes.hpp"

#include <gtest/gtest.h>

#include "runtime/bank/corrected.hpp"
#include "runtime/bank/mounting/heard.hpp"
#include "tests/unit/runtime/bank/example_bank.hpp"

namespace carillon::hear {
namespace {

TEST(StruckModes, DecayOnTheSupportsOfTheBank) {
  const bank::Bank stored = bank::example::make_mounted_bank();
  const std::vector<bank::HeardMode> info = mounting::calc_heard(stored);
  const std::vector<std::size_t> order = bank::sort_played_modes(stored);
  bank::Bank played = bank::calc_corrected(stored);
  const std::vector<bank::HeardMode> heard = mounting::mount(played);
  const std::vector<StruckMode> struck = list_modes(played, heard, 3, 5);
  ASSERT_EQ(struck.size(), 5U);
  for (std::size_t k = 0; k < struck.size(); ++k) {
    const bank::HeardMode& expected = info[order[k]];
    EXPECT_EQ(struck[k].heard.freq_hz, expected.freq_hz);
    EXPECT_EQ(struck[k].heard.calc_t60_s(), expected.calc_t60_s());
    EXPECT_GT(struck[k].heard.supports_per_s, 0.0);
    EXPECT_NEAR(played.decay_per_s[k], expected.calc_decay_per_s(), 1e-12 * played.decay_per_s[k]);
  }
}

}  // namespace
}  // namespace carillon::hear
