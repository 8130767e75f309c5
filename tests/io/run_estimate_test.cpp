// Percent and seconds left, for courses of events that the prices did not predict; and the estimates of modes against known counts.
#include "precompute/io/run_estimate.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "precompute/io/costs.hpp"
#include "precompute/io/weyl.hpp"

namespace carillon::io {
namespace {

Extent make_extent() {
  Extent extent;
  extent.tets = 20000;
  extent.nodes = 30000;
  extent.unknowns = 90000;
  return extent;
}

TEST(RunEstimate, never_falls_and_ends_at_100_whatever_happens) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    std::mt19937 random(seed);
    const auto draw = [&](double most) { return std::uniform_real_distribution<>(0, most)(random); };
    RunEstimate estimate(1 + static_cast<int>(seed % 4));
    if (seed % 3 == 0) estimate.expect_trials();
    double seconds = 0, before = 0;
    const auto look = [&] {
      const double percent = estimate.calc_percent(seconds);
      ASSERT_GE(percent, before) << "seed " << seed;
      ASSERT_LT(percent, 100) << "seed " << seed;
      const auto left = estimate.calc_seconds_left(seconds);
      ASSERT_GE(left.value_or(0), 0) << "seed " << seed;
      before = percent;
      seconds += draw(20);
    };
    for (int trial = 0; trial < (seed % 3 == 0 ? 3 : 1); ++trial) {
      for (const char* station : {"read", "partition", "assemble"}) {
        estimate.begin(station, seconds);
        look();
        if (draw(1) < 0.5) estimate.learn(make_extent());
        look();
      }
      estimate.begin("modes", seconds);
      eigen::Progress progress;
      for (const eigen::Phase phase : {eigen::Phase::kRigid, eigen::Phase::kAnalyse, eigen::Phase::kCount, eigen::Phase::kFactor}) {
        progress.phase = phase;
        progress.factorisations += static_cast<std::int64_t>(draw(4));
        if (phase == eigen::Phase::kFactor) progress.modes_wanted = static_cast<std::int64_t>(draw(900));
        if (phase == eigen::Phase::kFactor) progress.factor_flops = draw(1e12);
        estimate.advance(progress, seconds);
        look();
        look();
      }
      progress.phase = eigen::Phase::kIterate;
      for (int step = 0; step < 20; ++step) {
        progress.solves += 16 + static_cast<std::int64_t>(draw(100));
        estimate.advance(progress, seconds);
        look();
      }
      progress.phase = eigen::Phase::kCheck;
      estimate.advance(progress, seconds);
      look();
      estimate.begin("errors", seconds);
      look();
    }
    for (const char* station : {"collect", "write"}) {
      estimate.begin(station, seconds);
      look();
    }
    estimate.finish();
    EXPECT_EQ(estimate.calc_percent(seconds), 100);
    EXPECT_EQ(estimate.calc_seconds_left(seconds), 0);
  }
}

TEST(RunEstimate, a_run_at_the_predicted_prices_is_half_done_after_half_the_time) {
  Extent extent = make_extent();
  extent.factor_flops = 2e10;
  extent.factor_entries = 25000000;
  extent.modes = 200;
  const Costs costs = calc_wall(predict_costs(extent), extent, 1);
  RunEstimate estimate(1);
  estimate.learn(extent);
  double seconds = 0;
  estimate.begin("read", seconds);
  estimate.begin("partition", seconds += costs.read);
  estimate.begin("assemble", seconds += costs.partition);
  estimate.begin("modes", seconds += costs.assemble);
  eigen::Progress progress;
  progress.modes_wanted = 200;
  progress.phase = eigen::Phase::kAnalyse;
  estimate.advance(progress, seconds);
  progress.phase = eigen::Phase::kFactor;
  estimate.advance(progress, seconds += costs.analyse);
  progress.phase = eigen::Phase::kIterate;
  progress.factorisations = predict_factorisations(200);
  estimate.advance(progress, seconds += costs.factor);
  EXPECT_NEAR(estimate.calc_percent(seconds), 100 * seconds / costs.sum(), 2);
  EXPECT_NEAR(*estimate.calc_seconds_left(seconds), costs.sum() - seconds, 0.05 * costs.sum());
}

// What is known of a long bar,
// whose bending, torsion and stretching have closed forms: with its section small against the waves, the law for solids undercounts, and
// the bounds must still hold the truth.
TEST(Weyl, bounds_hold_the_modes_of_a_slender_bar) {
  job::Material steel;
  steel.density_kg_m3 = 7850;
  steel.young_modulus_pa = 2e11;
  steel.poisson_ratio = 0.3;
  const double length = 0.2, width = 0.03, thickness = 0.02, high_hz = 20000;
  const double c = std::sqrt(steel.young_modulus_pa / steel.density_kg_m3);
  // Euler-Bernoulli both ways, stretching, and torsion (Saint-Venant: J = 0.196 w h^3 for w = 1.5 h).
  int count = 0;
  for (const double depth : {width, thickness})
    for (int n = 1; n < 50; ++n) {
      const double root = n == 1 ? 4.7300 : n == 2 ? 7.8532 : (n + 0.5) * M_PI;
      count += root * root / (2 * M_PI) * c * depth / std::sqrt(12.0) / (length * length) <= high_hz ? 1 : 0;
    }
  const double torsion =
      std::sqrt(1 / 2.6) * c *
      std::sqrt(0.196 * width * std::pow(thickness, 3) / (width * thickness * (width * width + thickness * thickness) / 12));
  for (int n = 1; n < 50; ++n) {
    count += n * c / (2 * length) <= high_hz ? 1 : 0;
    count += n * torsion / (2 * length) <= high_hz ? 1 : 0;
  }
  const double area = 2 * (length * width + length * thickness + width * thickness);
  const ModeEstimate estimate = estimate_modes({steel}, {length * width * thickness}, area, 20, high_hz);
  EXPECT_LE(estimate.low, count);
  EXPECT_GE(estimate.high, count);
  EXPECT_FALSE(estimate.is_thin);
  // Far above the body is a solid: cubes of frequency.
  const ModeEstimate more = estimate_modes({steel}, {length * width * thickness}, area, 20, 200 * high_hz);
  const ModeEstimate twice = estimate_modes({steel}, {length * width * thickness}, area, 20, 400 * high_hz);
  EXPECT_NEAR(std::log2(twice.count / more.count), 3, 0.05);
}

}  // namespace
}  // namespace carillon::io
