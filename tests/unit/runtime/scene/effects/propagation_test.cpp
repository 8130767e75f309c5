// Effects of the way from a body to the ears: motion, ears, ground and head.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "tests/unit/runtime/scene/effects/stage.hpp"

namespace carillon::effects {
namespace {

using std::numbers::pi;

TEST(EffectSelector, DopplerIsForWaysThatChangeWhileTheySound) {
  Stage stage;
  stage.facts.moves = true;
  stage.body().fixed = false;
  stage.facts.microphones_m = {{0, 0, 0}};
  stage.body().position_m = {0.0, 2.0, 0.0};
  stage.body().overrides.off = {Effect::kAccelerationNoise};  // whose higher frequency would count
  // A phase error 2 pi f dx / c below sqrt(1e-5): 0.17 mm at 1 kHz.
  const double limit = std::sqrt(1e-5) * kC / (2.0 * pi * 1000.0);
  const auto has = [&](double way, double time_s) {
    const auto changes =
        play(stage.facts, {make_strike(0.5, 0.01), events::BodyMotion{.time_s = 0.6, .position_m = {0.0, 2.0 + way, 0.0}}});
    return find_effects(changes, time_s).has(Effect::kDoppler);
  };
  EXPECT_FALSE(has(0.9 * limit, 0.6));
  EXPECT_TRUE(has(1.1 * limit, 0.6));
  EXPECT_FALSE(has(1.1 * limit, 0.5)) << "still at rest, and not yet kLeadS before it moves";
  EXPECT_FALSE(has(1.1 * limit, 1.0)) << "at rest again";
  // Across the line of sight nothing changes.
  const auto changes = play(stage.facts, {make_strike(0.5, 0.01), events::BodyMotion{.time_s = 0.6, .position_m = {0.02, 2.0, 0.0}}});
  EXPECT_FALSE(find_effects(changes, 0.6).has(Effect::kDoppler));
}

TEST(EffectSelector, WhoWalksHearsDopplerFromBodiesAtRest) {
  Stage stage;
  stage.facts.listener = {{0.0, {0, 0, 0}}, {0.9, {0, 0, 0}}, {1.0, {0, 0, 0}}, {2.0, {0, 0.5, 0}}, {2.1, {0, 0.5, 0}}, {4.0, {0, 0.5, 0}}};
  const auto changes = play(stage.facts, {make_strike(0.2, 0.01), make_strike(1.5, 0.01), make_strike(3.2, 0.01)});
  EXPECT_FALSE(find_effects(changes, 0.3).has(Effect::kDoppler));
  EXPECT_TRUE(find_effects(changes, 1.5).has(Effect::kDoppler));
  EXPECT_FALSE(find_effects(changes, 3.6).has(Effect::kDoppler));
  stage.facts.listener = {{0.0, {0, 0, 0}}};
  EXPECT_EQ(EffectSelector(stage.facts).get_possible(0).without(Effect::kDoppler), EffectSelector(stage.facts).get_possible(0));
}

TEST(EffectSelector, HearsAListenerWhoWalksByEvents) {
  const auto walk = [](double y, double stop_s) {
    Stage stage;
    std::vector<events::Event> events;
    for (double time_s = 0.0; time_s <= stop_s; time_s += 1.0) {
      const Vec3 velocity{0, time_s == 1.0 ? y : 0.0, 0};
      events.emplace_back(events::Listener{.time_s = time_s, .position_m = {0, 0.5 * y * time_s, 0}, .velocity_m_s = velocity});
    }
    for (const double time_s : {0.2, 1.5, 3.2}) events.emplace_back(make_strike(time_s, 0.01));
    return play(stage.facts, events);
  };
  EXPECT_TRUE(find_effects(walk(0.5, 2.0), 1.5).has(Effect::kDoppler));
  EXPECT_FALSE(find_effects(walk(0.5, 2.0), 3.6).has(Effect::kDoppler)) << "stands again";
  EXPECT_FALSE(find_effects(walk(0.0, 2.0), 1.5).has(Effect::kDoppler)) << "stands all the time";
  EXPECT_TRUE(find_effects(walk(0.5, 1.0), 0.5).has(Effect::kDoppler)) << "one step from where the scene has him";

  Stage stage;
  EffectSelector selector(stage.facts);
  EXPECT_FALSE(selector.get_possible(0).has(Effect::kDoppler));
  selector.watch(events::Listener{.time_s = 1.0});
  EXPECT_TRUE(selector.get_possible(0).has(Effect::kDoppler));
  stage.body().struck = false;
  EffectSelector silent(stage.facts);
  silent.watch(events::Listener{.time_s = 1.0});
  EXPECT_EQ(silent.get_possible(0), EffectSet{}) << "of a body that makes no sound no way is heard";
}

TEST(EffectSelector, EventsContinueTheListenersPathOfTheScene) {
  Stage stage;
  stage.facts.listener = {{0.0, {0, 0, 0}}, {1.0, {0, 0, 0}}, {1.01, {0, 0, 0}}, {2.0, {0, 0.5, 0}}, {2.01, {0, 0.5, 0}}};
  const auto changes = play(stage.facts, {events::Listener{.time_s = 3.0, .position_m = {0, 0.5, 0}}, make_strike(0.2, 0.01),
                                          make_strike(1.5, 0.01), make_strike(3.2, 0.01)});
  EXPECT_FALSE(find_effects(changes, 0.3).has(Effect::kDoppler));
  EXPECT_TRUE(find_effects(changes, 1.5).has(Effect::kDoppler));
  EXPECT_FALSE(find_effects(changes, 3.6).has(Effect::kDoppler));
}

TEST(EffectSelector, ABodyComesToRestAndIsStruckAgain) {
  Stage stage;
  stage.facts.moves = true;
  stage.body().fixed = false;
  std::vector<events::Event> events;
  const auto fall = [&](double from_s, double to_s, double height) {
    for (int i = 0; from_s + 0.002 * i <= to_s; ++i) {
      const double t = 0.002 * i;
      events.emplace_back(
          events::BodyMotion{.time_s = from_s + t, .position_m = {0.4, 2.0, height - 0.5 * t}, .velocity_m_s = {0, 0, -0.5}});
    }
  };
  events.emplace_back(make_strike(0.2, 3.0));
  fall(0.2, 0.4, 0.0);
  for (int i = 0; i < 500; ++i) events.emplace_back(events::BodyMotion{.time_s = 0.402 + 0.002 * i, .position_m = {0.4, 2.0, -0.1}});
  events.emplace_back(make_strike(1.2, 3.0));
  events.emplace_back(make_strike(2.0, 3.0));
  fall(2.0, 2.2, -0.1);
  std::stable_sort(events.begin(), events.end(),
                   [](const auto& a, const auto& b) { return events::get_time_s(a) < events::get_time_s(b); });
  const auto changes = play(stage.facts, events);
  EXPECT_FALSE(find_effects(changes, 0.1).has(Effect::kModal));
  EXPECT_TRUE(find_effects(changes, 0.3).has(Effect::kDoppler));
  EXPECT_FALSE(find_effects(changes, 0.8).has(Effect::kDoppler)) << "it lies";
  EXPECT_TRUE(find_effects(changes, 0.8).has(Effect::kModal)) << "and rings";
  EXPECT_FALSE(find_effects(changes, 1.25).has(Effect::kDoppler)) << "a strike where it lies moves nothing";
  EXPECT_TRUE(find_effects(changes, 2.05).has(Effect::kDoppler));
  int switched = 0;
  for (const EffectChange& change : changes)
    for (const EffectSwitch& one : change.switches) switched += one.effect == Effect::kDoppler && one.on;
  EXPECT_EQ(switched, 2);
}

TEST(EffectSelector, TwoEarsAreForSourcesOffTheMiddle) {
  Stage stage;
  const auto has = [&](double x) {
    stage.body().position_m = {x, 2.0, 0.0};
    return find_effects(play(stage.facts, {make_strike(0.5, 0.01)}), 0.5).has(Effect::kTwoEars);
  };
  EXPECT_TRUE(has(0.0)) << "both ears are 2.5 mm farther away than the middle between them";
  // Two microphones 2 cm apart: the ways differ from that to the middle by 0.01 x / r, and 0.17 mm is audible at 1 kHz.
  stage.facts.microphones_m = {{-0.01, 0.0, 0.0}, {0.01, 0.0, 0.0}};
  const double limit = std::sqrt(1e-5) * kC / (2.0 * pi * 1000.0) * 2.0 / 0.01;
  EXPECT_FALSE(has(0.0));
  EXPECT_FALSE(has(0.8 * limit));
  EXPECT_TRUE(has(1.2 * limit));
  stage.facts.microphones_m = {{0.3, 0.0, 0.0}};
  EXPECT_FALSE(has(0.5));
}

TEST(EffectSelector, TheGroundIsHeardWhereItReflectsEnough) {
  Stage stage;
  const auto has_ground = [&] { return find_effects(play(stage.facts, {make_strike(0.5, 0.01)}), 0.5).has(Effect::kGroundReflection); };
  EXPECT_FALSE(has_ground());
  stage.facts.floor = synth::Floor{.point_m = {0.0, 0.0, -1.0}};
  EXPECT_TRUE(has_ground());
  EffectSelector selector(stage.facts);
  selector.watch(make_strike(0.5, 0.01));
  selector.advance(10.0);
  // Of the two ears the farther one has the ways more alike: its squared distance and 4 m^2 more, twice the height.
  const double straight = 0.5 * 0.5 + 4.0;
  EXPECT_NEAR(selector.get_plan(0)[Effect::kGroundReflection].reason.value, 10.0 * std::log10(straight / (straight + 4.0)), 1e-6);
  stage.facts.floor->reflection = 1e-3;
  EXPECT_FALSE(has_ground());
}

TEST(EffectSelector, AHeadHearsWhateverIsHeard) {
  Stage stage;
  const auto play_strike = [&](double impulse_n_s) {
    EffectSelector selector(stage.facts);
    selector.watch(make_strike(0.5, impulse_n_s));
    const auto changes = selector.advance(10.0);
    return std::pair(find_effects(changes, 0.5), selector.get_plan(0));
  };
  const auto [free, without] = play_strike(0.01);
  EXPECT_FALSE(free.has(Effect::kHead));
  EXPECT_EQ(without[Effect::kHead].cost_us, 0.0);
  EXPECT_EQ(describe(without[Effect::kHead].reason), "the listener's ears are free");
  stage.facts.has_head = true;
  stage.facts.microphones_m = {{1e-9, 0.0, 0.0}, {-1e-9, 0.0, 0.0}};  // ways that are the same
  const auto [heard, with] = play_strike(0.01);
  EXPECT_TRUE(heard.has(Effect::kHead) && heard.has(Effect::kTwoEars));
  EXPECT_GT(with[Effect::kHead].cost_us, 0.0);
  EXPECT_EQ(with[Effect::kTwoEars].cost_us, 0.0) << "the head has one receiver";
  EXPECT_EQ(describe(with[Effect::kHead].reason), "the listener has a head");
  EXPECT_FALSE(find_effects(EffectSelector(stage.facts).advance(10.0), 0.5).has(Effect::kHead)) << "of a body that is silent";
  stage.body().overrides.off = {Effect::kTwoEars};
  const auto [mono, deaf] = play_strike(0.01);
  EXPECT_FALSE(mono.has(Effect::kHead));
  EXPECT_EQ(deaf[Effect::kHead].reason.rule, SelectionReason::Rule::kNeedsOther);
}

}  // namespace
}  // namespace carillon::effects
