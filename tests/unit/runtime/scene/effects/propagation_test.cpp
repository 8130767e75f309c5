// Effects of propagation: motion, ears, ground and head.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "tests/unit/runtime/scene/effects/stage.hpp"

namespace carillon::effects {
namespace {

using std::numbers::pi;

TEST(EffectSelector, DopplerNeedsAChangingDistanceWhileTheBodySounds) {
  Stage stage;
  stage.facts.moves = true;
  stage.body().fixed = false;
  stage.facts.microphones_m = {{0, 0, 0}};
  stage.body().position_m = {0.0, 2.0, 0.0};
  stage.body().overrides.off = {Effect::kAccelerationNoise};  // whose higher frequency would count
  // A phase error 2 pi f dx / c below sqrt(1e-5): 0.17 mm at 1 kHz.
  const double limit = std::sqrt(1e-5) * kC / (2.0 * pi * 1000.0);
  const auto has = [&](const Vec3& move, double time_s) {
    const events::BodyMotion motion{.time_s = time_s, .position_m = {move[0], 2.0 + move[1], 0.0}};
    return play(stage.facts, {make_strike(0.5, 0.01), motion}).has(Effect::kDoppler);
  };
  EXPECT_FALSE(has({0.0, 0.9 * limit, 0.0}, 0.6));
  EXPECT_TRUE(has({0.0, 1.1 * limit, 0.0}, 0.6));
  EXPECT_FALSE(has({0.0, 1.1 * limit, 0.0}, 3.0)) << "silent again";
  EXPECT_FALSE(has({0.02, 0.0, 0.0}, 0.6)) << "across the line of sight";
}

TEST(EffectSelector, AMovingListenerCallsForDopplerWhileABodySounds) {
  Stage stage;
  stage.facts.listener = {{0.0, {0, 0, 0}}, {0.9, {0, 0, 0}}, {1.0, {0, 0, 0}}, {2.0, {0, 0.5, 0}}, {2.1, {0, 0.5, 0}}, {4.0, {0, 0.5, 0}}};
  const auto has = [&](double time_s) { return play(stage.facts, {make_strike(time_s, 1e-4)}).has(Effect::kDoppler); };
  EXPECT_FALSE(has(0.2));
  EXPECT_TRUE(has(1.5));
  EXPECT_FALSE(has(3.2));
  stage.facts.listener = {{0.0, {0, 0, 0}}};
  EXPECT_EQ(EffectSelector(stage.facts).get_possible(0).without(Effect::kDoppler), EffectSelector(stage.facts).get_possible(0));
}

TEST(EffectSelector, AListenerMayMoveByEvents) {
  const auto has = [](double y, double stop_s, double strike_s) {
    Stage stage;
    std::vector<events::Event> events;
    for (double time_s = 0.0; time_s <= stop_s; time_s += 1.0) {
      const Vec3 velocity{0, time_s == 1.0 ? y : 0.0, 0};
      events.emplace_back(events::Listener{.time_s = time_s, .position_m = {0, 0.5 * y * time_s, 0}, .velocity_m_s = velocity});
    }
    events.emplace_back(make_strike(strike_s, 1e-4));
    return play(stage.facts, events).has(Effect::kDoppler);
  };
  EXPECT_TRUE(has(0.5, 2.0, 1.5));
  EXPECT_FALSE(has(0.5, 2.0, 3.2)) << "at rest again";
  EXPECT_FALSE(has(0.0, 2.0, 1.5)) << "never moves";
  EXPECT_TRUE(has(0.5, 1.0, 0.5)) << "one step from the initial position";

  Stage stage;
  EffectSelector selector(stage.facts);
  EXPECT_FALSE(selector.get_possible(0).has(Effect::kDoppler));
  selector.watch(events::Listener{.time_s = 1.0});
  EXPECT_TRUE(selector.get_possible(0).has(Effect::kDoppler));
  stage.body().struck = false;
  EffectSelector silent(stage.facts);
  silent.watch(events::Listener{.time_s = 1.0});
  EXPECT_EQ(silent.get_possible(0), EffectSet{}) << "a silent body has no propagation";
}

TEST(EffectSelector, EventsContinueTheListenersPathOfTheScene) {
  Stage stage;
  stage.facts.listener = {{0.0, {0, 0, 0}}, {1.0, {0, 0, 0}}, {1.01, {0, 0, 0}}, {2.0, {0, 0.5, 0}}, {2.01, {0, 0.5, 0}}};
  const events::Listener walk{.time_s = 3.0, .position_m = {0, 0.5, 0}};
  const auto has = [&](double time_s) { return play(stage.facts, {walk, make_strike(time_s, 1e-4)}).has(Effect::kDoppler); };
  EXPECT_FALSE(has(0.2));
  EXPECT_TRUE(has(1.5));
  EXPECT_FALSE(has(3.2));
}

TEST(EffectSelector, AMotionBetweenTwoSoundsIsNoDoppler) {
  // Strikes at rest, in two places.
  Stage stage;
  stage.facts.moves = true;
  stage.body().fixed = false;
  std::vector<events::Event> events{make_strike(0.2, 1e-4)};
  for (int i = 0; i < 50; ++i)
    events.emplace_back(events::BodyMotion{.time_s = 2.0 + 0.002 * i, .position_m = {0.4, 2.0, -0.002 * i}, .velocity_m_s = {0, 0, -1.0}});
  events.emplace_back(make_strike(3.0, 1e-4));
  EXPECT_FALSE(play(stage.facts, events).has(Effect::kDoppler));
  events.insert(events.begin() + 20, make_strike(2.03, 1e-4));
  EXPECT_TRUE(play(stage.facts, events).has(Effect::kDoppler));
}

TEST(EffectSelector, TwoEarsAreForSourcesOffTheMiddle) {
  Stage stage;
  const auto has = [&](double x) {
    stage.body().position_m = {x, 2.0, 0.0};
    return play(stage.facts, {make_strike(0.5, 0.01)}).has(Effect::kTwoEars);
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

TEST(EffectSelector, GroundReflectionNeedsAnAudibleReflection) {
  Stage stage;
  const auto has_ground = [&] { return play(stage.facts, {make_strike(0.5, 0.01)}).has(Effect::kGroundReflection); };
  EXPECT_FALSE(has_ground());
  stage.facts.floor = synth::Floor{.point_m = {0.0, 0.0, -1.0}};
  EXPECT_TRUE(has_ground());
  EffectSelector selector(stage.facts);
  selector.watch(make_strike(0.5, 0.01));
  selector.advance(10.0);
  // The paths of the farther ear are more alike: its squared distance, and 4 m^2 more (twice the height).
  const double straight = 0.5 * 0.5 + 4.0;
  EXPECT_NEAR(selector.get_plan(0)[Effect::kGroundReflection].reason.value, 10.0 * std::log10(straight / (straight + 4.0)), 1e-6);
  stage.facts.floor->reflection = 1e-3;
  EXPECT_FALSE(has_ground());
}

TEST(EffectSelector, AHeadIsOnForAllAudibleBodies) {
  Stage stage;
  const auto play_strike = [&](double impulse_n_s) {
    EffectSelector selector(stage.facts);
    selector.watch(make_strike(0.5, impulse_n_s));
    selector.advance(10.0);
    return std::pair(selector.choose(0), selector.get_plan(0));
  };
  const auto [free, without] = play_strike(0.01);
  EXPECT_FALSE(free.has(Effect::kHead));
  EXPECT_EQ(describe(without[Effect::kHead].reason), "the listener has no head");
  stage.facts.has_head = true;
  stage.facts.microphones_m = {{1e-9, 0.0, 0.0}, {-1e-9, 0.0, 0.0}};  // ways that are the same
  const auto [heard, with] = play_strike(0.01);
  EXPECT_TRUE(heard.has(Effect::kHead) && heard.has(Effect::kTwoEars));
  EXPECT_EQ(describe(with[Effect::kHead].reason), "the listener has a head or Ambisonics");
  EXPECT_FALSE(play(stage.facts, {}).has(Effect::kHead)) << "silent body";
  stage.body().overrides.off = {Effect::kTwoEars};
  const auto [mono, deaf] = play_strike(0.01);
  EXPECT_FALSE(mono.has(Effect::kHead));
  EXPECT_EQ(deaf[Effect::kHead].reason.rule, SelectionReason::Rule::kNeedsOther);
}

}  // namespace
}  // namespace carillon::effects
