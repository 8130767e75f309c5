// Overrides, partition of time and the table.
#include "runtime/scene/effects/effect_selector.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "runtime/base/error.hpp"
#include "runtime/scene/effects/table.hpp"
#include "tests/unit/runtime/scene/effects/stage.hpp"

namespace carillon::effects {
namespace {

TEST(EffectSelector, TheSceneOverridesTheRules) {
  Stage stage;
  stage.body().overrides = {.automatic = true, .on = {Effect::kRolling}, .off = {Effect::kAirDelay}};
  EffectSelector selector(stage.facts);
  EXPECT_EQ(selector.choose(0), (EffectSet{Effect::kModal, Effect::kRolling})) << "rolling brings its base";
  selector.watch(make_strike(0.5, 0.01, 1e-3));
  selector.advance(10.0);
  EXPECT_EQ(selector.choose(0), (EffectSet{Effect::kModal, Effect::kHertzPulse, Effect::kTwoEars, Effect::kRolling}));
  EXPECT_EQ(selector.get_plan(0)[Effect::kDoppler].reason.rule, SelectionReason::Rule::kNeedsOther);
  EXPECT_EQ(selector.get_plan(0)[Effect::kAirDelay].reason.rule, SelectionReason::Rule::kForced);
  stage.body().overrides = {.automatic = false, .on = {Effect::kDoppler, Effect::kModal}, .off = {}};
  EXPECT_EQ(play(stage.facts, {make_strike(0.5, 0.01, 1e-3)}), (EffectSet{Effect::kDoppler, Effect::kModal})) << "exactly the list";
}

TEST(EffectSelector, ChoiceDoesNotDependOnTheCallsOfAdvance) {
  Stage stage;
  stage.facts.moves = true;
  stage.body().fixed = false;
  std::vector<events::Event> events;
  for (int i = 0; i < 100; ++i) {
    events.emplace_back(make_strike(0.02 * i + 0.003, 0.01 / (i + 1), 1e-4 * (i % 7)));
    events.emplace_back(events::BodyMotion{.time_s = 0.02 * i + 0.004, .position_m = {0.4, 2.0, 0.001 * i}});
  }
  EffectSelector whole(stage.facts), pieces(stage.facts);
  for (const auto& event : events) {
    whole.watch(event);
    pieces.watch(event);
    pieces.advance(events::get_time_s(event));
  }
  for (EffectSelector* selector : {&whole, &pieces}) selector->advance(std::numeric_limits<double>::infinity());
  EXPECT_EQ(whole.choose(0), pieces.choose(0));
  for (const Effect effect : EffectSet::all()) {
    EXPECT_EQ(whole.get_plan(0)[effect].reason.value, pieces.get_plan(0)[effect].reason.value) << synth::get_name(effect);
    EXPECT_EQ(whole.get_plan(0)[effect].reason.rule, pieces.get_plan(0)[effect].reason.rule) << synth::get_name(effect);
  }
}

TEST(EffectSelector, NeedsContactsOnlyIfAnEffectMayDependOnThem) {
  Stage stage;
  EXPECT_FALSE(EffectSelector(stage.facts).needs_contacts());
  stage.facts.moves = true;
  EXPECT_TRUE(EffectSelector(stage.facts).needs_contacts());
  stage.body().overrides.off = {Effect::kRoughness, Effect::kRolling, Effect::kContactDamping};
  EXPECT_FALSE(EffectSelector(stage.facts).needs_contacts());
  stage.body().overrides = {.automatic = false, .on = {Effect::kModal}, .off = {}};
  EXPECT_FALSE(EffectSelector(stage.facts).needs_contacts());
}

TEST(EffectSelector, NothingIsStruckAndNothingMoves) {
  Stage stage;
  stage.body().struck = false;
  EXPECT_EQ(EffectSelector(stage.facts).get_possible(0), EffectSet{});
  EffectSelector selector(stage.facts);
  selector.advance(10.0);
  EXPECT_EQ(selector.choose(0), EffectSet{});
  EXPECT_EQ(describe(selector.get_plan(0)[Effect::kModal].reason), "no event for this body");
}

TEST(EffectSelector, BadEventsAreIgnored) {
  Stage stage;
  EffectSelector selector(stage.facts);
  events::Impulse strike = make_strike(0.5, 0.01);
  for (const std::int32_t body : {-1, 1, 1000000}) {
    strike.body = body;
    selector.watch(strike);
  }
  strike = make_strike(0.5, std::nan(""));
  selector.watch(strike);
  strike = make_strike(0.5, 0.01);
  strike.triangle = 4000;
  selector.watch(strike);
  selector.advance(10.0);
  EXPECT_EQ(selector.choose(0), EffectSet{});
  stage.body().bank = nullptr;
  EXPECT_THROW(EffectSelector(stage.facts), InputError);
}

TEST(EffectSelector, TheTableListsEffectsAndReasons) {
  Stage stage;
  EffectSelector selector(stage.facts);
  selector.watch(make_strike(0.5, 0.01, 1e-3));
  selector.advance(10.0);
  const std::string text = format_plan(selector, stage.facts);
  for (const Effect effect : EffectSet::all()) EXPECT_NE(text.find(synth::get_name(effect)), std::string::npos);
  for (const char* part : {"cube, fixed, 1 modes", "modal               on    audible, ", "acceleration_noise  off   the body is fixed",
                           "body and listener are at rest", "no lasting contact"})
    EXPECT_NE(text.find(part), std::string::npos) << part << '\n' << text;
  EXPECT_NE(make_plan_json(selector, 0).line().find("\"doppler\": {\"on\": false, \"why\": \"body and listener are at rest\"}"),
            std::string::npos);
}

}  // namespace
}  // namespace carillon::effects
