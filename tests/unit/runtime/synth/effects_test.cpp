#include "runtime/synth/effects.hpp"

#include <gtest/gtest.h>

#include <set>
#include <string>
#include <vector>

namespace carillon::synth {
namespace {

TEST(Effects, EveryEffectHasANameThatFindsIt) {
  std::set<std::string> names;
  for (int i = 0; i < kEffectCount; ++i) {
    const auto effect = static_cast<Effect>(i);
    EXPECT_EQ(find_effect(get_name(effect)), effect);
    names.insert(get_name(effect));
  }
  EXPECT_EQ(names,
            (std::set<std::string>{"modal", "hertz_pulse", "roughness", "rolling", "contact_damping", "acceleration_noise", "air_delay",
                                   "doppler", "two_ears", "directivity", "ground_reflection", "head", "nonlinear", "cascade"}));
  EXPECT_EQ(find_effect("two ears"), std::nullopt);
  EXPECT_EQ(find_effect(""), std::nullopt);
}

TEST(Effects, SetsHoldTheirEffects) {
  constexpr EffectSet set{Effect::kModal, Effect::kTwoEars};
  static_assert(set.has(Effect::kTwoEars) && !set.has(Effect::kDoppler));
  EXPECT_EQ(set.with(Effect::kDoppler).without(Effect::kTwoEars), (EffectSet{Effect::kDoppler, Effect::kModal}));
  EXPECT_EQ(EffectSet::all().without(set).with(set), EffectSet::all());
  for (int i = 0; i < kEffectCount; ++i) EXPECT_TRUE(EffectSet::all().has(static_cast<Effect>(i)));
  EXPECT_EQ(EffectSet{}.with(set).without(set), EffectSet{});
}

TEST(Effects, SetsIterateInTheOrderOfTheList) {
  const auto list = [](EffectSet set) { return std::vector<Effect>(set.begin(), set.end()); };
  EXPECT_EQ(list({}), std::vector<Effect>{});
  EXPECT_EQ(list({Effect::kTwoEars, Effect::kModal, Effect::kRolling}),
            (std::vector<Effect>{Effect::kModal, Effect::kRolling, Effect::kTwoEars}));
  for (unsigned mask = 0; mask < 1U << static_cast<unsigned>(kEffectCount); ++mask) {
    const EffectSet set = EffectSet::from_mask(mask);
    std::vector<Effect> expected;
    for (int i = 0; i < kEffectCount; ++i)
      if ((mask >> static_cast<unsigned>(i) & 1U) != 0) expected.push_back(static_cast<Effect>(i));
    ASSERT_EQ(list(set), expected) << mask;
    ASSERT_EQ(set.has_any(kContactEffects), set.has(Effect::kRoughness) || set.has(Effect::kRolling) || set.has(Effect::kContactDamping));
  }
}

TEST(Effects, PerEffectHoldsAValueForEach) {
  PerEffect<int> values;
  values.fill(3);
  values[Effect::kTwoEars] = 5;
  EXPECT_EQ(std::vector<int>(values.begin(), values.end()), (std::vector<int>{3, 3, 3, 3, 3, 3, 3, 3, 5, 3, 3, 3, 3, 3}));
}

}  // namespace
}  // namespace carillon::synth
