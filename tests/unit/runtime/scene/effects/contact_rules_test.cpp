// Effects of lasting contacts.
#include "runtime/scene/effects/contact_rules.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/unit/runtime/scene/effects/stage.hpp"

namespace carillon::effects {
namespace {

TEST(EffectSelector, LastingContactsCallForTheirEffects) {
  Stage stage;
  stage.facts.moves = true;
  stage.body().fixed = false;
  const auto touch = [&](events::LastingContact contact, bool struck) {
    contact.time_s = 1.0;
    contact.triangle = 3;
    contact.force_n = 2.0;
    contact.normal = {0, 0, 1};
    contact.patch_radius_m = 1e-4;
    std::vector<events::Event> events;
    if (struck) events.emplace_back(make_strike(0.9, 0.01));
    events.emplace_back(contact);
    return play(stage.facts, events);
  };
  EXPECT_EQ(touch({}, false), EffectSet{}) << "a body at rest makes no sound";
  EXPECT_TRUE(touch({.slip_m_s = {0.05, 0, 0}, .other_sweep_m_s = 0.05}, false).has(Effect::kRoughness));
  EXPECT_TRUE(touch({.slip_m_s = {0.05, 0, 0}, .other_sweep_m_s = 0.05}, false).has(Effect::kModal));
  EXPECT_FALSE(touch({.slip_m_s = {0.0001, 0, 0}, .other_sweep_m_s = 0.0001}, false).has(Effect::kRoughness));
  EXPECT_TRUE(touch({.sweep_m_s = 0.3, .spin_rad_s = 10.0}, false).has(Effect::kRolling));
  EXPECT_FALSE(touch({.sweep_m_s = 0.3, .spin_rad_s = 10.0}, false).has(Effect::kRoughness));
  // A dashpot z adds z phi^2 / 2 to the decay d = 20 / s of a mode of phi = 1; e = sqrt(2e-5) of the decay is audible.
  const double limit = 2.0 * 20.0 * std::sqrt(2.0 * kAudibleShare);
  EXPECT_TRUE(touch({.impedance_n_s_m = 0.1 * limit}, true).has(Effect::kContactDamping)) << "the contact's own spring loses more";
  stage.facts.ground.modulus_pa = 0.0;  // no spring
  EXPECT_FALSE(touch({.impedance_n_s_m = 0.9 * limit}, true).has(Effect::kContactDamping));
  EXPECT_TRUE(touch({.impedance_n_s_m = 1.1 * limit}, true).has(Effect::kContactDamping));
  EXPECT_FALSE(touch({.impedance_n_s_m = 1e3}, false).has(Effect::kContactDamping)) << "silent body";
}

TEST(EffectSelector, AContactAtRestDampsLaterStrikesUntilItEnds) {
  // A contact at rest has no further records.
  Stage stage;
  stage.facts.moves = true;
  stage.body().fixed = false;
  events::LastingContact contact{
      .time_s = 0.2, .id = 7, .triangle = 3, .normal = {0, 0, 1}, .force_n = 2.0, .patch_radius_m = 1e-4, .impedance_n_s_m = 5.0};
  EXPECT_FALSE(play(stage.facts, {contact}).has(Effect::kContactDamping)) << "silent body";
  EXPECT_TRUE(play(stage.facts, {contact, make_strike(0.4, 3.0)}).has(Effect::kContactDamping));
  events::LastingContact end = contact;
  end.time_s = 0.3;
  end.state = events::ContactState::kEnd;
  EXPECT_FALSE(play(stage.facts, {contact, end, make_strike(0.4, 3.0)}).has(Effect::kContactDamping));
}

TEST(EffectSelector, ExposureChangesByHalfTheSquareOfTheErrorOfADecay) {
  // The exposure of e^{-t} - e^{-(1 + e) t} against that of e^{-t}: e^2 / 2.
  const double e = 0.01;
  double difference = 0.0, whole = 0.0;
  for (int i = 0; i < 200000; ++i) {
    const double t = (i + 0.5) * 1e-4;
    difference += std::pow(std::exp(-t) - std::exp(-(1.0 + e) * t), 2.0);
    whole += std::exp(-2.0 * t);
  }
  EXPECT_NEAR(difference / whole, 0.5 * e * e, 0.03 * 0.5 * e * e);
}

}  // namespace
}  // namespace carillon::effects
