// Changes of effects over a scene, overrides, costs and the table.
#include "runtime/scene/effects/effect_selector.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "runtime/base/error.hpp"
#include "runtime/scene/effects/table.hpp"
#include "tests/unit/runtime/scene/effects/stage.hpp"

namespace carillon::effects {
namespace {

TEST(EffectSelector, TheSceneHasTheLastWord) {
  Stage stage;
  stage.body().overrides = {.automatic = true, .on = {Effect::kRolling}, .off = {Effect::kAirDelay}};
  EffectSelector selector(stage.facts);
  selector.watch(make_strike(0.5, 0.01, 1e-3));
  const auto changes = selector.advance(10.0);
  EXPECT_EQ(find_effects(changes, 0.0), (EffectSet{Effect::kModal, Effect::kRolling})) << "rolling brings what it acts on";
  EXPECT_EQ(find_effects(changes, 0.5), (EffectSet{Effect::kModal, Effect::kHertzPulse, Effect::kTwoEars, Effect::kRolling}));
  EXPECT_EQ(selector.get_plan(0)[Effect::kDoppler].reason.rule, SelectionReason::Rule::kNeedsOther);
  EXPECT_EQ(selector.get_plan(0)[Effect::kAirDelay].reason.rule, SelectionReason::Rule::kForced);
  stage.body().overrides = {.automatic = false, .on = {Effect::kDoppler, Effect::kModal}, .off = {}};
  const auto listed = play(stage.facts, {make_strike(0.5, 0.01, 1e-3)});
  ASSERT_EQ(listed.size(), 1u);
  EXPECT_EQ(listed[0].effects, (EffectSet{Effect::kDoppler, Effect::kModal})) << "exactly the list";
}

TEST(EffectSelector, AHailOfStrikesDoesNotMakeItFlap) {
  Stage stage;
  stage.facts.moves = true;
  stage.body().fixed = false;
  std::vector<events::Event> events;
  for (int i = 0; i < 200; ++i) {
    const double t = 0.5 + 0.01 * i;
    events.emplace_back(make_strike(t, 0.01, i % 2 == 0 ? 1e-3 : 0.0));
    events.emplace_back(events::BodyMotion{.time_s = t, .position_m = {0.4, 2.0, i % 2 == 0 ? 0.0 : 0.05}});
  }
  const auto changes = play(stage.facts, events);
  synth::PerEffect<int> on;
  for (const EffectChange& change : changes)
    for (const EffectSwitch& one : change.switches) on[one.effect] += one.on;
  for (const int times : on) EXPECT_LE(times, 1);
  EXPECT_EQ(on[Effect::kDoppler], 1);
}

TEST(EffectSelector, DecidesTheSameHoweverTheEventsCome) {
  Stage stage;
  stage.facts.moves = true;
  stage.body().fixed = false;
  std::vector<events::Event> events;
  for (int i = 0; i < 100; ++i) {
    events.emplace_back(make_strike(0.02 * i + 0.003, 0.01 / (i + 1), 1e-4 * (i % 7)));
    events.emplace_back(events::BodyMotion{.time_s = 0.02 * i + 0.004, .position_m = {0.4, 2.0, 0.001 * i}});
  }
  const auto whole = play(stage.facts, events);
  EffectSelector selector(stage.facts);
  std::vector<EffectChange> pieces;
  for (const auto& event : events) {
    selector.watch(event);
    for (auto& change : selector.advance(events::get_time_s(event))) pieces.push_back(change);
  }
  for (auto& change : selector.advance(std::numeric_limits<double>::infinity())) pieces.push_back(change);
  ASSERT_EQ(whole.size(), pieces.size());
  for (std::size_t i = 0; i < whole.size(); ++i) {
    EXPECT_EQ(whole[i].time_s, pieces[i].time_s);
    EXPECT_EQ(whole[i].effects, pieces[i].effects);
  }
}

TEST(EffectSelector, PhysicsRecordsContactsOnlyWhereAPlanMayHangOnThem) {
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
  const auto changes = selector.advance(10.0);
  ASSERT_EQ(changes.size(), 1u);
  EXPECT_EQ(changes[0].switches.size(), static_cast<std::size_t>(synth::kEffectCount));
  EXPECT_EQ(describe(selector.get_plan(0)[Effect::kModal].reason), "nothing happens to the body");
}

TEST(EffectSelector, BadEventsAreNotLookedAt) {
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
  EXPECT_EQ(find_effects(selector.advance(10.0), 0.5), EffectSet{});
  stage.body().bank = nullptr;
  EXPECT_THROW(EffectSelector(stage.facts), InputError);
}

TEST(EffectSelector, TheTableSaysWhatAndWhy) {
  Stage stage;
  EffectSelector selector(stage.facts);
  selector.watch(make_strike(0.5, 0.01, 1e-3));
  const auto changes = selector.advance(10.0);
  const std::string text = format_plan(selector, stage.facts);
  for (const Effect effect : EffectSet::all()) EXPECT_NE(text.find(synth::get_name(effect)), std::string::npos);
  EXPECT_NE(text.find("cube, fixed, 1 modes"), std::string::npos) << text;
  EXPECT_NE(text.find("heard with"), std::string::npos) << text;
  EXPECT_NE(text.find("a body that cannot move has none"), std::string::npos) << text;
  EXPECT_NE(text.find("neither the body nor the listener moves"), std::string::npos) << text;
  EXPECT_NE(text.find("no contact lasts"), std::string::npos) << text;
  EXPECT_NE(make_plan_json(selector, stage.facts, 0).line().find("\"doppler\": {\"on_s\": 0.000"), std::string::npos);
  EXPECT_NE(make_changes_json(changes, stage.facts, 1000).line().find("\"effect\": \"modal\", \"on\": true"), std::string::npos);
}

TEST(EffectSelector, PredictedCostIsUnitsTimesWhatTheyCost) {
  Stage stage;
  stage.facts.microphones_m = {{0, 0, 0}};
  const Costs costs{.mode_sample_ns = 2.0, .voice_sample_ns = 0.0, .event_ns = 0.0, .strike_mode_ns = 0.0, .ear_sample_ns = 3.0};
  EffectSelector selector(stage.facts, costs);
  selector.watch(make_strike(0.5, 0.01));
  selector.advance(10.0);
  const double distance = std::hypot(0.4, 2.0), amplitude = 0.05 * 0.01 / distance;
  const double limit_db = std::min(0.0, 10.0 * std::log10(amplitude * amplitude / 80.0 / 0.2 / 4e-10) - 70.0);
  const double rung_s = std::log(amplitude / (20e-6 * std::pow(10.0, limit_db / 20.0))) / 20.0;
  EXPECT_NEAR(selector.get_plan(0)[Effect::kModal].cost_us, 1e-3 * rung_s * 48000.0 * 2.0, 0.01 * rung_s * 96.0);
  EXPECT_NEAR(selector.get_plan(0)[Effect::kAirDelay].cost_us, 1e-3 * (rung_s + distance / kC + kLeadS) * 48000.0 * 3.0, 0.03 * 144.0);
}

}  // namespace
}  // namespace carillon::effects
