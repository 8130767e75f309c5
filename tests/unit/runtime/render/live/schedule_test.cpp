// Times at which planned effects reach a body.
#include "runtime/render/live/schedule.hpp"

#include <gtest/gtest.h>

#include <vector>

namespace carillon::live {
namespace {

using synth::Effect;
using synth::EffectSet;

TEST(Schedule, AddsEffectsAheadAndRemovesThemInTime) {
  const EffectSet none{}, rings{Effect::kModal}, rolls{Effect::kModal, Effect::kRolling};
  Schedule schedule(2);
  schedule.add({0.0, 0, none, {}});
  schedule.add({0.0, 1, rings, {}});
  schedule.add({1.0, 0, rings, {}});
  schedule.add({1.1, 0, rolls, {}});
  schedule.add({3.0, 0, none, {}});
  std::vector<EffectSet> now(2);
  int calls = 0;
  const auto advance = [&](double now_s) {
    calls = 0;
    schedule.apply(now_s, now_s + 0.2, [&](std::size_t body, EffectSet effects) { now[body] = effects, ++calls; });
  };
  advance(0.0);
  EXPECT_EQ(calls, 2);
  EXPECT_EQ(now[0], none);
  EXPECT_EQ(now[1], rings);
  advance(0.7);
  EXPECT_EQ(calls, 0) << "nothing new";
  advance(0.85);
  EXPECT_EQ(now[0], rings) << "before its time, for what is handed on before";
  advance(0.95);
  EXPECT_EQ(now[0], rolls);
  advance(2.95);
  EXPECT_EQ(now[0], rolls) << "none of it goes before its time";
  advance(3.0);
  EXPECT_EQ(now[0], none);
  EXPECT_EQ(now[1], rings);
}

}  // namespace
}  // namespace carillon::live
