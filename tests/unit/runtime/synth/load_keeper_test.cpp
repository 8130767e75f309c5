// LoadKeeper on a machine of known cost.
#include "runtime/synth/load_keeper.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace carillon::synth {
namespace {

constexpr double kUnlimited = std::numeric_limits<double>::infinity();

/// Machine with a load of `fixed` cores plus `per_mode_sample` seconds for work, of which `wanted` per second are requested.
struct Machine {
  double fixed = 0.0, per_mode_sample = 0.0, wanted = 0.0;
  LoadSample now{};

  double play(double seconds, double budget) {
    const double work = std::min(budget, wanted);
    const double load = fixed + per_mode_sample * work;
    now.busy_s += load * seconds;
    now.played_s += seconds;
    now.mode_samples += work * seconds;
    return load;
  }
  /// Plays so many tenths of a second, looked at after each; the budget at the end.
  double keep(LoadKeeper& keeper, double share, double budget, int times) {
    for (int i = 0; i < times; ++i) {
      play(0.1, budget);
      budget = keeper.calc_budget(share, now, budget);
      EXPECT_GT(budget, 0.0);
    }
    return budget;
  }
};

TEST(LoadKeeper, ComesToTheShareAndStays) {
  for (const double share : {0.1, 0.3, 0.9}) {
    for (const double fixed : {0.0, 0.3 * share, 0.8 * share}) {
      Machine machine{.fixed = fixed, .per_mode_sample = 2e-10, .wanted = 8e9};  // 160 % of a core
      LoadKeeper keeper;
      double budget = kUnlimited, load = 0.0;
      for (int i = 0; i < 100; ++i) {
        load = machine.play(0.1, budget);
        budget = keeper.calc_budget(share, machine.now, budget);
        if (i > 30) {
          EXPECT_LT(load, 1.1 * share) << fixed;
          EXPECT_GT(load, 0.85 * share) << fixed;
        }
      }
    }
  }
}

TEST(LoadKeeper, KeepsAndRestoresTheBudgetWithRoom) {
  Machine machine{.fixed = 0.02, .per_mode_sample = 2e-10, .wanted = 5e8};
  LoadKeeper keeper;
  for (int i = 0; i < 20; ++i) EXPECT_EQ(machine.keep(keeper, 0.3, kUnlimited, 1), kUnlimited);
  machine.wanted = 1e10;
  double budget = machine.keep(keeper, 0.3, kUnlimited, 20);
  EXPECT_LT(budget, 2e9);
  machine.wanted = 1e8;
  budget = machine.keep(keeper, 0.3, budget, 100);
  EXPECT_EQ(budget, kUnlimited);
}

TEST(LoadKeeper, SurvivesImpossibleSharesAndWrongClocks) {
  Machine machine{.fixed = 0.7, .per_mode_sample = 2e-10, .wanted = 1e9};
  LoadKeeper keeper;
  double budget = machine.keep(keeper, 0.3, kUnlimited, 100);
  EXPECT_LT(budget, 1e6);
  machine.fixed = 0.1;  // and comes back
  budget = machine.keep(keeper, 0.3, budget, 150);
  EXPECT_GT(budget, 8e8);
  const double before = budget;
  machine.now.busy_s -= 1.0;
  machine.now.played_s += 0.1;
  EXPECT_EQ(keeper.calc_budget(0.3, machine.now, budget), before);
  machine.now.played_s += 0.001;
  EXPECT_EQ(keeper.calc_budget(0.3, machine.now, budget), before);
  machine.now.busy_s = std::nan("");
  machine.now.played_s += 0.1;
  EXPECT_EQ(keeper.calc_budget(0.3, machine.now, budget), before);
}

}  // namespace
}  // namespace carillon::synth
