// A rule of the selector a test, on the same few scenes: longer than most files.
#include "runtime/effect_selection/effect_selector.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>

#include "runtime/base/error.hpp"
#include "runtime/effect_selection/table.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::effect_selection {
namespace {

using std::numbers::pi;
using testing::make_cube_bank;

constexpr double kC = 343.0;

/// A cube of 10 cm, 2 m in front of two ears, that is struck and does not move.
struct Stage {
  bank::Bank bank = make_cube_bank({{1000.0, 20.0, 0.05}});
  SceneFacts facts;

  Stage() {
    facts.duration_s = 4.0;
    facts.microphones_m = {{-0.1, 0.0, 0.0}, {0.1, 0.0, 0.0}};
    facts.bodies.push_back({.name = "cube", .bank = &bank, .fixed = true, .struck = true, .position_m = {0.4, 2.0, 0.0}});
    facts.moves = false;
  }
  BodyFacts& body() { return facts.bodies[0]; }
};

events::Impulse make_strike(double time_s, double impulse_n_s, double duration_s = 0.0) {
  return {.time_s = time_s, .triangle = 3, .impulse_n_s = {0, 0, impulse_n_s}, .duration_s = duration_s};
}

/// What a body has at a time.
EffectSet find_effects(const std::vector<EffectChange>& changes, double time_s, int body = 0) {
  EffectSet effects;
  for (const EffectChange& change : changes) {
    if (change.body == body && change.time_s <= time_s) effects = change.effects;
  }
  return effects;
}

std::vector<EffectChange> play(const SceneFacts& facts, const std::vector<events::Event>& events) {
  EffectSelector selector(facts);
  for (const events::Event& event : events) selector.watch(event);
  return selector.advance(std::numeric_limits<double>::infinity());
}

/// |P| of the pulse by quadrature.
double calc_spectrum(double cycles) {
  double sum = 0.0, area = 0.0;
  for (int i = 0; i < 100000; ++i) {
    const double x = (i + 0.5) / 100000, force = std::pow(std::sin(pi * x), 1.5);
    area += force;
    sum += force * std::cos(2.0 * pi * cycles * (x - 0.5));
  }
  return sum / area;
}

TEST(EffectSelector, ABodyThatIsStruckHasWhatItsStrikeCallsFor) {
  Stage stage;
  const auto changes = play(stage.facts, {make_strike(1.0, 0.01, 1e-3)});
  ASSERT_FALSE(changes.empty());
  EXPECT_EQ(changes[0].time_s, 0.0);
  EXPECT_EQ(changes[0].effects, EffectSet{}) << "nothing has happened yet";
  EXPECT_EQ(find_effects(changes, 1.0), (EffectSet{Effect::kModal, Effect::kHertzPulse, Effect::kAirDelay, Effect::kTwoEars}));
  EXPECT_EQ(find_effects(changes, 0.5), EffectSet{});
  EXPECT_EQ(changes.size(), 3u) << "once on and once off";
  EXPECT_LE(changes[1].time_s, 1.0 - kLeadS);
}

// Two thousand steps of 1 us each: a Hertz pulse of 2 ms. Each piece of it alone is 40 dB less.
TEST(EffectSelector, APulseInPiecesIsJudgedAsOne) {
  constexpr double kLength = 2e-3;
  constexpr int kSteps = 2000;
  const auto make_pieces = [](double impulse_n_s) {
    std::vector<Vec3> steps;
    for (int k = 0; k < kSteps; ++k) steps.push_back({0, 0, std::pow(std::sin(pi * (k + 0.5) / kSteps), 1.5)});
    double area = 0.0;
    for (const Vec3& step : steps) area += step[2];
    for (Vec3& step : steps) step[2] *= impulse_n_s / area;
    std::vector<events::Event> events;
    events::split_force({.time_s = 1.0 - 0.5 * kLength, .step_s = kLength / kSteps, .triangle = 3}, steps,
                        [&](const events::Force& piece) { events.emplace_back(piece); });
    return events;
  };
  Stage stage;
  for (const double impulse_n_s : {0.01, 1e-6, 1e-9}) {
    const auto as_one = play(stage.facts, {make_strike(1.0, impulse_n_s, kLength)}),
               in_pieces = play(stage.facts, make_pieces(impulse_n_s));
    ASSERT_EQ(in_pieces.size(), as_one.size()) << impulse_n_s;
    for (std::size_t i = 0; i < as_one.size(); ++i) {
      EXPECT_EQ(in_pieces[i].effects, as_one[i].effects) << impulse_n_s;
      EXPECT_NEAR(in_pieces[i].time_s, as_one[i].time_s, 0.011) << impulse_n_s;
    }
  }
}

TEST(EffectSelector, APulseInPiecesCostsWhatItsLengthAndItsStepsDo) {
  // Sixteen steps an event: 125 events of one pulse of 2 ms. Each of them pays for itself alone.
  constexpr double kLength = 2e-3;
  constexpr int kSteps = 2000;
  Stage stage;
  const Costs costs{.mode_sample_ns = 0.0,
                    .voice_sample_ns = 0.0,
                    .event_ns = 11.0,
                    .strike_mode_ns = 0.0,
                    .pulse_mode_sample_ns = 3.0,
                    .force_mode_ns = 7.0,
                    .step_mode_ns = 5.0,
                    .ear_sample_ns = 0.0};
  EffectSelector selector(stage.facts, costs);
  events::split_force({.time_s = 1.0 - 0.5 * kLength, .step_s = kLength / kSteps, .triangle = 3},
                      std::vector<Vec3>(kSteps, {0, 0, 1.0 / kSteps}), [&](const events::Force& piece) { selector.watch(piece); });
  selector.advance(stage.facts.duration_s);
  const double modes = static_cast<double>(stage.facts.bodies[0].bank->mode_count());
  // Of the first pieces it is not known yet that the pulse will be long enough to be audibly different from a blow.
  EXPECT_NEAR(selector.get_plan(0)[Effect::kHertzPulse].cost_us, 1e-3 * modes * kLength * 48000.0 * 3.0, 5e-2 * modes * kLength * 144.0);
  EXPECT_NEAR(selector.get_plan(0)[Effect::kModal].cost_us, 1e-3 * modes * kSteps * (5.0 + (11.0 + 7.0) / 16.0), 1e-4 * modes * kSteps);
}

TEST(EffectSelector, ItIsOffWhenItHasDiedAwayAndTheSoundHasArrived) {
  Stage stage;
  const auto changes = play(stage.facts, {make_strike(1.0, 0.01)});
  // p = g phi J at 1 m: 0.05 x 0.01 Pa; less than 20 uPa is inaudible, at 2.04 m, and by kBelowLoudestDb not earlier.
  const double distance = std::hypot(0.3, 2.0), amplitude = 0.05 * 0.01 / distance;
  const double exposure = amplitude * amplitude / 80.0;
  const double limit_db = std::min(0.0, 10.0 * std::log10(exposure / (0.2 * 4e-10)) - 70.0);
  const double quiet_s = 1.0 + std::log(amplitude / (20e-6 * std::pow(10.0, limit_db / 20.0))) / 20.0 + distance / kC;
  EXPECT_NEAR(changes.back().time_s, quiet_s + kHoldS, 0.011);
  EXPECT_EQ(changes.back().effects, EffectSet{});
}

TEST(EffectSelector, WhatIsInaudibleIsOff) {
  Stage stage;
  stage.facts.bodies.push_back(stage.body());
  std::vector<events::Event> events{make_strike(0.5, 0.01)};
  events::Impulse faint = make_strike(0.6, 1e-9);
  faint.body = 1;
  events.emplace_back(faint);
  EffectSelector selector(stage.facts);
  for (const auto& event : events) selector.watch(event);
  const auto changes = selector.advance(10.0);
  EXPECT_EQ(find_effects(changes, 0.6, 1), EffectSet{});
  EXPECT_EQ(selector.get_plan(1)[Effect::kModal].reason.rule, SelectionReason::Rule::kTooQuiet);
  // By hand: exposure (0.05 x 1e-9 / r)^2 / 80 within 0.2 s.
  const double distance = std::hypot(0.3, 2.0), amplitude = 0.05e-9 / distance;
  EXPECT_NEAR(selector.get_plan(1)[Effect::kModal].reason.value, 10.0 * std::log10(amplitude * amplitude / 80.0 / 0.2 / 4e-10), 0.1);
  // The same strike alone is the loudest of its scene, and played: files are made as loud as they can be.
  faint.body = 0;
  EXPECT_TRUE(find_effects(play(stage.facts, {faint}), 0.6).has(Effect::kModal));
}

TEST(EffectSelector, BodiesWithoutAudibleModesDoNotRing) {
  Stage stage;
  stage.bank = make_cube_bank({{12.0, 1.0}, {26000.0, 5.0}});
  EffectSelector selector(stage.facts);
  selector.watch(make_strike(0.5, 0.01));
  const auto changes = selector.advance(10.0);
  EXPECT_EQ(find_effects(changes, 0.5), EffectSet{});
  EXPECT_EQ(selector.get_plan(0)[Effect::kModal].reason.rule, SelectionReason::Rule::kNoModes);
}

TEST(EffectSelector, PulsesLastWhereTheirLengthIsHeard) {
  Stage stage;
  // (1 - P)^2 of the sound is what an ideal impulse adds: the threshold by bisection on the quadrature.
  double low = 1e-6, high = 1e-3;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high), pulse = calc_spectrum(1000.0 * middle);
    (std::pow((1.0 - pulse) / pulse, 2.0) < kAudibleShare ? low : high) = middle;
  }
  EXPECT_NEAR(low, 6.5e-5, 0.5e-5) << "65 us for 1 kHz";
  const auto has = [&](double duration) {
    return find_effects(play(stage.facts, {make_strike(0.5, 0.01, duration)}), 0.5).has(Effect::kHertzPulse);
  };
  EXPECT_FALSE(has(0.98 * low));
  EXPECT_TRUE(has(1.02 * low));
  EXPECT_FALSE(has(0.0));
}

TEST(EffectSelector, ADieClicksAndABoxDoesNot) {
  // A solid die of 2 cm has no mode that is heard; a hollow box of 50 cm does, from 100 Hz on (docs/examples/blocks).
  Stage stage;
  stage.facts.moves = true;
  stage.body().fixed = false;
  bank::Bank die = make_cube_bank({{34000.0, 50.0, 1.0}}, 1200.0);
  for (auto& vertex : die.vertices_m)
    for (double& x : vertex) x *= 0.2;
  die.rigid.mass_kg = 1200.0 * 8e-6;
  stage.body().bank = &die;
  EffectSelector of_die(stage.facts);
  of_die.watch(make_strike(0.5, 0.01 * 1.5, 6e-5));  // 10 g stopped and thrown back from 1 m/s
  EXPECT_TRUE(find_effects(of_die.advance(10.0), 0.5).has(Effect::kAccelerationNoise));
  EXPECT_TRUE(of_die.get_plan(0)[Effect::kAirDelay].ever);
  EXPECT_FALSE(of_die.get_plan(0)[Effect::kModal].ever);

  bank::Bank box = make_cube_bank({{100.0, 27.0, 12.0}, {160.0, 30.0, 24.0}, {320.0, 40.0, 60.0}, {700.0, 120.0, 120.0}}, 150.0);
  for (auto& vertex : box.vertices_m)
    for (double& x : vertex) x *= 5.0;
  box.rigid.mass_kg = 19.0;
  stage.body().bank = &box;
  const auto knock = [&] {
    EffectSelector selector(stage.facts);
    selector.watch(make_strike(0.5, 19.0 * 1.5, 2e-3));
    const auto changes = selector.advance(10.0);
    EXPECT_TRUE(find_effects(changes, 0.5).has(Effect::kModal));
    return std::make_pair(find_effects(changes, 0.5).has(Effect::kAccelerationNoise),
                          selector.get_plan(0)[Effect::kAccelerationNoise].reason);
  };
  // Its thump is 10 to 40 dB below what rings: inaudible next to it. As much of a click of a smaller body is audible.
  EXPECT_FALSE(knock().first);
  EXPECT_EQ(knock().second.rule, SelectionReason::Rule::kThump);
  EXPECT_LT(knock().second.value, -10.0);
  EXPECT_GT(knock().second.value, -40.0);
  // Without a sound of its own the thump is all that is heard of it.
  for (double& gain : box.radiation_gain) gain *= 1e-3;
  EXPECT_TRUE(knock().first);
  for (double& gain : box.radiation_gain) gain *= 1e3;
  for (auto& vertex : box.vertices_m)
    for (double& x : vertex) x *= 0.25;
  box.rigid.mass_kg /= 64.0;
  EXPECT_TRUE(knock().first);
  EXPECT_EQ(knock().second.rule, SelectionReason::Rule::kChange);
}

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

TEST(EffectSelector, ContactsThatLastCallForWhatTheyDo) {
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
    return find_effects(play(stage.facts, events), 1.0);
  };
  EXPECT_EQ(touch({}, false), EffectSet{}) << "a body that lies still makes no sound";
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
  EXPECT_FALSE(touch({.impedance_n_s_m = 1e3}, false).has(Effect::kContactDamping)) << "of a body that is silent";
}

TEST(EffectSelector, WhatLiesDampsUntilItIsLifted) {
  // Of a contact at rest no more records come; it still damps, until its end.
  Stage stage;
  stage.facts.moves = true;
  stage.body().fixed = false;
  events::LastingContact contact{
      .time_s = 0.5, .id = 7, .triangle = 3, .normal = {0, 0, 1}, .force_n = 2.0, .patch_radius_m = 1e-4, .impedance_n_s_m = 5.0};
  std::vector<events::Event> events{make_strike(0.4, 3.0), contact};
  EXPECT_TRUE(find_effects(play(stage.facts, events), 1.0).has(Effect::kContactDamping));
  contact.time_s = 0.6;
  contact.state = events::ContactState::kEnd;
  events.emplace_back(contact);
  EXPECT_TRUE(find_effects(play(stage.facts, events), 0.6).has(Effect::kContactDamping));
  EXPECT_FALSE(find_effects(play(stage.facts, events), 1.0).has(Effect::kContactDamping));
}

TEST(EffectSelector, ADecayThatIsALittleWrongChangesTheSoundAsTheRuleSays) {
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

/// Multipoles of the cube's one mode.
void give_multipoles(bank::Bank& bank, const std::vector<double>& multipoles) {
  constexpr double kRadius = 0.09;
  bank.multipoles = {};
  bank.multipoles.radius_m = bank.multipoles.nearest_m = kRadius;
  bank.multipoles.air_density_kg_m3 = 1.2;
  bank.multipoles.sound_speed_ms = bank::kSoundSpeedMs;
  bank.multipoles.freq_hz = {1000.0};
  bank.multipoles.order = {static_cast<int>(std::sqrt(static_cast<double>(multipoles.size()))) - 1};
  bank.multipoles.scale = {0.05 / kRadius / 1000.0};
  for (const double a : multipoles) {
    bank.multipoles.coefficient.push_back(static_cast<std::int16_t>(1000.0 * a));
    bank.multipoles.coefficient.push_back(0);
  }
  bank.multipoles.decay_per_s = bank.multipoles.added_mass = {0.0};
  bank.multipoles.error_db = {-60.0};
}

// The level of a dipole has 20 log |cos|, evenly over the cosine, cut at -20 dB of its mean power: its standard deviation by quadrature.
TEST(EffectSelector, DirectivityIsForBodiesThatSendMoreOneWayThanAnother) {
  double sum = 0.0, squares = 0.0;
  constexpr int kSteps = 100000;
  for (int i = 0; i < kSteps; ++i) {
    const double cosine = (i + 0.5) / kSteps, level = 10.0 * std::log10(std::max(3.0 * cosine * cosine, 0.01));
    sum += level / kSteps;
    squares += level * level / kSteps;
  }
  const double spread_db = std::sqrt(squares - sum * sum);
  Stage stage;
  const auto play_blow = [&](double impulse_n_s) {
    EffectSelector selector(stage.facts);
    selector.watch(make_strike(0.5, impulse_n_s));
    const bool is_on = find_effects(selector.advance(10.0), 0.5).has(Effect::kDirectivity);
    const EffectPlan plan = selector.get_plan(0)[Effect::kDirectivity];
    EXPECT_EQ(plan.cost_us > 0.0, is_on);
    return std::pair(is_on, plan.reason);
  };
  EXPECT_EQ(describe(play_blow(0.01).second), "the bank has no multipoles");
  give_multipoles(stage.bank, {1.0, 0.02, 0.02, 0.0});
  const auto [round_on, round] = play_blow(0.01);
  EXPECT_FALSE(round_on);
  EXPECT_EQ(round.rule, SelectionReason::Rule::kSameAllRound);
  give_multipoles(stage.bank, {0.0, 0.0, 1.0, 0.0});
  const auto [dipole_on, dipole] = play_blow(0.01);
  EXPECT_TRUE(dipole_on);
  EXPECT_EQ(dipole.rule, SelectionReason::Rule::kDirected);
  EXPECT_NEAR(dipole.value, spread_db, 0.25);
  // Next to one that is 65 dB louder no direction of it is heard.
  bank::Bank other = make_cube_bank({{1000.0, 20.0, 0.05}});
  SceneFacts two = stage.facts;
  two.bodies.push_back(two.bodies[0]);
  two.bodies[1].bank = &other;
  for (const double below_db : {50.0, 65.0}) {
    EffectSelector selector(two);
    const double loud_n_s = 1e-6;
    events::Impulse loud = make_strike(0.4, loud_n_s);
    loud.body = 1;
    selector.watch(loud);
    selector.watch(make_strike(0.5, loud_n_s * std::pow(10.0, -below_db / 20.0)));
    const auto changes = selector.advance(10.0);
    EXPECT_TRUE(find_effects(changes, 0.5).has(Effect::kModal));
    EXPECT_EQ(find_effects(changes, 0.5).has(Effect::kDirectivity), below_db < 60.0);
    EXPECT_EQ(selector.get_plan(0)[Effect::kDirectivity].reason.rule,
              below_db < 60.0 ? SelectionReason::Rule::kDirected : SelectionReason::Rule::kFaint);
  }
  stage.body().overrides.off = {Effect::kDirectivity};
  EXPECT_FALSE(play_blow(0.01).first);
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

/// The effects behind a blow at 0.5 s, and the plan of one of them.
auto select_for_strike(const Stage& stage, double impulse_n_s, Effect effect) {
  EffectSelector selector(stage.facts);
  selector.watch(make_strike(0.5, impulse_n_s));
  const auto changes = selector.advance(10.0);
  return std::pair(find_effects(changes, 0.5), selector.get_plan(0)[effect]);
}

TEST(EffectSelector, NonlinearMotionIsThatOfABlowThatRaisesAMode) {
  Stage stage;
  const auto play_strike = [&](double impulse_n_s) { return select_for_strike(stage, impulse_n_s, Effect::kNonlinear); };
  const auto [linear, none] = play_strike(1.0);
  EXPECT_FALSE(linear.has(Effect::kNonlinear));
  EXPECT_EQ(describe(none.reason), "the bank has no nonlinear energy");
  bank::Bank bank = *stage.body().bank;
  bank.quartic.modes = {0};
  bank.quartic.rows = {1e7F};
  stage.body().bank = &bank;
  const auto [hard, high] = play_strike(1.0);
  EXPECT_TRUE(hard.has(Effect::kNonlinear) && hard.has(Effect::kModal));
  EXPECT_EQ(high.reason.rule, SelectionReason::Rule::kHardens);
  EXPECT_GT(high.cost_us, 0.0);
  // Cents go with the square of the blow: where it is just too soft it is off, and it costs nothing.
  const double just = std::sqrt(kHardeningCents / high.reason.value);
  EXPECT_TRUE(play_strike(1.01 * just).first.has(Effect::kNonlinear));
  const auto [soft, low] = play_strike(0.99 * just);
  EXPECT_FALSE(soft.has(Effect::kNonlinear));
  EXPECT_NEAR(low.reason.value, 0.99 * 0.99 * kHardeningCents, 1e-6);
  EXPECT_EQ(low.cost_us, 0.0);
  EXPECT_EQ(describe(low.reason), "a strike raises a mode by 2.94 cents, less than 3");
  // Twice as hard: longer, by the time in which the amplitude falls to a half.
  const double decay_per_s = bank.decay_per_s[0];
  EXPECT_NEAR(play_strike(16.0 * just).second.on_s - play_strike(8.0 * just).second.on_s, std::log(2.0) / decay_per_s, 2.0 * kTickS);
  stage.body().overrides.off = {Effect::kNonlinear};
  EXPECT_FALSE(play_strike(1.0).first.has(Effect::kNonlinear));
}

TEST(EffectSelector, ACascadeIsThatOfAHardBlowOnABankWithModesAbove) {
  Stage stage;
  const auto play_strike = [&](double impulse_n_s) { return select_for_strike(stage, impulse_n_s, Effect::kCascade); };
  EXPECT_EQ(describe(play_strike(1.0).second.reason), "the bank has no nonlinear energy");
  bank::Bank bank = make_cube_bank({{1000.0, 20.0, 0.05}, {1700.0, 30.0, 0.05}});
  bank.quartic.modes = {0};
  bank.quartic.rows = {1e7F};
  bank.rigid.mass_kg = 1.0;
  stage.body().bank = &bank;
  EXPECT_EQ(describe(play_strike(1.0).second.reason), "the bank has no modes above the coupled ones, or no thickness");
  bank.quartic.thickness_m = 1e-3;
  const double just = std::sqrt(kCascadeCents / play_strike(1.0).second.reason.value);
  const auto [hard, high] = play_strike(1.01 * just);
  EXPECT_TRUE(hard.has(Effect::kCascade) && hard.has(Effect::kNonlinear));
  EXPECT_GT(high.cost_us, 0.0);
  const auto [soft, low] = play_strike(0.99 * just);
  EXPECT_FALSE(soft.has(Effect::kCascade));
  EXPECT_TRUE(soft.has(Effect::kNonlinear));
  EXPECT_EQ(low.cost_us, 0.0);
  stage.body().overrides.off = {Effect::kNonlinear};
  EXPECT_FALSE(play_strike(1.01 * just).first.has(Effect::kCascade));
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
}  // namespace carillon::effect_selection
