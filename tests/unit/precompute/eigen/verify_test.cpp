// Comparison of counts and modes, without a solve.
#include <gtest/gtest.h>

#include <limits>
#include <string>
#include <vector>

#include "precompute/eigen/proof.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"

namespace carillon::eigen {
namespace {

const std::vector<double> kModes{4.0, 1.0, 2.0, 2.0, 3.0};

double keep(double lambda) { return lambda; }

TEST(Verify, accepts_counts_that_match_the_modes) {
  const std::vector<Inertia> counts{{4.5, 11}, {0.5, 6}, {2.5, 9}};  // in any order; six lie below
  EXPECT_NO_THROW(verify(counts, kModes, 5, keep));
  EXPECT_EQ(count_found(kModes, 0.5, 2.5), 3);
  EXPECT_EQ(count_found(kModes, 1.0, 2.0), 1) << "the lower end belongs to the interval";
}

TEST(Verify, names_the_interval_where_modes_are_missing_or_too_many) {
  for (const std::int64_t below : {8, 10}) {
    tests::expect_error<SolveError>({"Between 0.5 and 2.5 Hz", std::to_string(below - 6) + " modes, and 3 were found"}, [&] {
      verify({{0.5, 6}, {2.5, below}, {4.5, 11}}, kModes, 5, keep);
    });
  }
}

TEST(Verify, ends_where_the_search_ended) {
  const std::vector<Inertia> counts{{0.5, 6}, {2.5, 9}, {4.5, 99}};
  EXPECT_NO_THROW(verify(counts, kModes, 2.4, keep));
  EXPECT_THROW(verify(counts, kModes, 2.6, keep), SolveError);
  EXPECT_EQ(find_end_of_search(kModes, std::nullopt, 7), 7);
  EXPECT_EQ(find_end_of_search(kModes, 3, 7), 2.0) << "the third mode";
  EXPECT_EQ(find_end_of_search(kModes, 6, 7), 7) << "fewer were found";
}

TEST(SaferShift, moves_a_count_off_a_mode) {
  const BandLimits limits{0.9, 4.1};
  EXPECT_FALSE(find_safer_shift(kModes, 2.5, limits));
  EXPECT_FALSE(find_safer_shift(kModes, 3 * (1 + 2e-7), limits)) << "far enough";
  const std::optional<double> moved = find_safer_shift(kModes, 3 * (1 + 1e-8), limits);
  ASSERT_TRUE(moved);
  EXPECT_GT(find_margin(kModes, *moved), 0.1);
  EXPECT_EQ(*find_safer_shift({4.1}, 4.1, limits), 4.1 * (1 + 1e-6)) << "an end moves outwards";
  EXPECT_EQ(*find_safer_shift({0.9}, 0.9, limits), 0.9 * (1 - 1e-6));
  EXPECT_FALSE(find_safer_shift({2.0}, 2.0, limits)) << "one mode leaves no gap";
}

TEST(ModeOutside, is_the_nearest_between_an_end_and_its_count) {
  const BandLimits limits{1.5, 3.5};
  EXPECT_EQ(find_mode_outside(kModes, 5.0, limits, true), 4.0);
  EXPECT_EQ(find_mode_outside(kModes, 3.6, limits, true), 3.6) << "none lies between";
  EXPECT_EQ(find_mode_outside(kModes, 0.5, limits, false), 1.0);
}

TEST(SelectWanted, takes_the_lowest_of_the_band_and_whole_clusters) {
  const WantedModes all = select_wanted(kModes, {1.5, 4 * (1 - 1e-10)}, std::nullopt);
  EXPECT_EQ(all.order, (std::vector<std::size_t>{2, 3, 4, 0})) << "an end belongs to the band to 1e-9";
  EXPECT_EQ(all.others, std::vector<double>{1.0});
  EXPECT_EQ(all.within, 4);
  const WantedModes two = select_wanted(kModes, {0.5, 5}, 2);
  EXPECT_EQ(two.order, (std::vector<std::size_t>{1, 2, 3})) << "2.0 twice is one cluster";
  EXPECT_EQ(two.within, 5);
}

TEST(Margin, is_relative_to_the_count) {
  EXPECT_DOUBLE_EQ(find_margin(kModes, 2.5), 0.2);
  EXPECT_EQ(find_margin({}, 2.5), std::numeric_limits<double>::infinity());
}

}  // namespace
}  // namespace carillon::eigen
