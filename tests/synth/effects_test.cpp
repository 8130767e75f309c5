#include "runtime/synth/effects.hpp"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace carillon::synth {
namespace {

TEST(Effects, EveryEffectHasANameThatFindsIt) {
  std::set<std::string> names;
  for (int i = 0; i < kEffectCount; ++i) {
    const auto effect = static_cast<Effect>(i);
    EXPECT_EQ(find_effect(get_name(effect)), effect);
    names.insert(get_name(effect));
  }
  EXPECT_EQ(names, (std::set<std::string>{"modal", "hertz_pulse", "roughness", "rolling", "contact_damping", "acceleration_noise",
                                          "air_delay", "doppler", "two_ears"}));
  EXPECT_EQ(find_effect("two ears"), std::nullopt);
  EXPECT_EQ(find_effect(""), std::nullopt);
}

TEST(Effects, ASetHoldsWhatWasPutIn) {
  constexpr EffectSet set{Effect::kModal, Effect::kTwoEars};
  static_assert(set.has(Effect::kTwoEars) && !set.has(Effect::kDoppler));
  EXPECT_EQ(set.with(Effect::kDoppler).without(Effect::kTwoEars), (EffectSet{Effect::kDoppler, Effect::kModal}));
  EXPECT_EQ(EffectSet::all().without(set).with(set), EffectSet::all());
  for (int i = 0; i < kEffectCount; ++i) EXPECT_TRUE(EffectSet::all().has(static_cast<Effect>(i)));
  EXPECT_EQ(EffectSet{}.with(set).without(set), EffectSet{});
}

}  // namespace
}  // namespace carillon::synth
