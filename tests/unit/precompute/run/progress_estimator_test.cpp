// Percent and seconds left, for courses of events that the prices did not predict; and the estimates of modes against known counts.
#include "precompute/run/progress_estimator.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "precompute/job/cost/seconds.hpp"

namespace carillon::run {
namespace {

cost::ProblemSize make_extent() {
  cost::ProblemSize size;
  size.tets = 20000;
  size.nodes = 30000;
  size.unknowns = 90000;
  return size;
}

TEST(ProgressEstimator, never_falls_and_ends_at_100_whatever_happens) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    std::mt19937 random(seed);
    const auto draw = [&](double max) { return std::uniform_real_distribution<>(0, max)(random); };
    ProgressEstimator estimate(1 + static_cast<int>(seed % 4));
    if (seed % 3 == 0) estimate.begin_trials();
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
      for (const char* phase : {"read", "partition", "assemble"}) {
        estimate.begin(phase, seconds);
        look();
        if (draw(1) < 0.5) estimate.set_size(make_extent());
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
    for (const char* phase : {"collect", "write"}) {
      estimate.begin(phase, seconds);
      look();
    }
    estimate.finish();
    EXPECT_EQ(estimate.calc_percent(seconds), 100);
    EXPECT_EQ(estimate.calc_seconds_left(seconds), 0);
  }
}

TEST(ProgressEstimator, a_run_at_the_predicted_prices_is_half_done_after_half_the_time) {
  cost::ProblemSize size = make_extent();
  size.factor_flops = 2e10;
  size.factor_entries = 25000000;
  size.modes = 200;
  const cost::PhaseSeconds costs = cost::calc_wall(cost::predict_seconds(size), size, 1);
  ProgressEstimator estimate(1);
  estimate.set_size(size);
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
  progress.factorisations = cost::predict_factorisations(200);
  estimate.advance(progress, seconds += costs.factor);
  EXPECT_NEAR(estimate.calc_percent(seconds), 100 * seconds / costs.sum(), 2);
  EXPECT_NEAR(*estimate.calc_seconds_left(seconds), costs.sum() - seconds, 0.05 * costs.sum());
}

}  // namespace
}  // namespace carillon::run
