// Effects of strikes.
#include "runtime/scene/effects/strike_rules.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <utility>
#include <vector>

#include "tests/unit/runtime/scene/effects/stage.hpp"

namespace carillon::effects {
namespace {

using std::numbers::pi;

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

TEST(EffectSelector, AStrikeCallsForModesPulseDelayAndEars) {
  Stage stage;
  EXPECT_EQ(play(stage.facts, {make_strike(1.0, 0.01, 1e-3)}),
            (EffectSet{Effect::kModal, Effect::kHertzPulse, Effect::kAirDelay, Effect::kTwoEars}));
}

// 2000 steps of 1 us: a Hertz pulse of 2 ms. Each piece alone is 40 dB less.
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
    EXPECT_EQ(play(stage.facts, make_pieces(impulse_n_s)), play(stage.facts, {make_strike(1.0, impulse_n_s, kLength)})) << impulse_n_s;
  }
}

TEST(EffectSelector, InaudibleBodiesHaveNoEffects) {
  Stage stage;
  stage.facts.bodies.push_back(stage.body());
  std::vector<events::Event> events{make_strike(0.5, 0.01)};
  events::Impulse faint = make_strike(0.6, 1e-9);
  faint.body = 1;
  events.emplace_back(faint);
  EffectSelector selector(stage.facts);
  for (const auto& event : events) selector.watch(event);
  selector.advance(10.0);
  EXPECT_EQ(selector.choose(1), EffectSet{});
  EXPECT_EQ(selector.get_plan(1)[Effect::kModal].reason.rule, SelectionReason::Rule::kTooQuiet);
  // By hand: exposure (0.05 x 1e-9 / r)^2 / 80 within 0.2 s.
  const double distance = std::hypot(0.3, 2.0), amplitude = 0.05e-9 / distance;
  EXPECT_NEAR(selector.get_plan(1)[Effect::kModal].reason.value, 10.0 * std::log10(amplitude * amplitude / 80.0 / 0.2 / 4e-10), 0.1);
  // Alone it is the loudest strike of its scene, and audible: files are normalised.
  faint.body = 0;
  EXPECT_TRUE(play(stage.facts, {faint}).has(Effect::kModal));
}

TEST(EffectSelector, BodiesWithoutAudibleModesDoNotRing) {
  Stage stage;
  stage.bank = make_cube_bank({{12.0, 1.0}, {26000.0, 5.0}});
  EffectSelector selector(stage.facts);
  selector.watch(make_strike(0.5, 0.01));
  selector.advance(10.0);
  EXPECT_EQ(selector.choose(0), EffectSet{});
  EXPECT_EQ(selector.get_plan(0)[Effect::kModal].reason.rule, SelectionReason::Rule::kNoModes);
}

TEST(EffectSelector, PulseLengthNeedsAnAudibleDifference) {
  Stage stage;
  // An ideal impulse adds (1 - P)^2 of the sound: threshold by bisection on the quadrature.
  double low = 1e-6, high = 1e-3;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high), pulse = calc_spectrum(1000.0 * middle);
    (std::pow((1.0 - pulse) / pulse, 2.0) < kAudibleShare ? low : high) = middle;
  }
  EXPECT_NEAR(low, 6.5e-5, 0.5e-5) << "65 us for 1 kHz";
  const auto has = [&](double duration) { return play(stage.facts, {make_strike(0.5, 0.01, duration)}).has(Effect::kHertzPulse); };
  EXPECT_FALSE(has(0.98 * low));
  EXPECT_TRUE(has(1.02 * low));
  EXPECT_FALSE(has(0.0));
}

TEST(EffectSelector, ADieClicksAndABoxDoesNot) {
  // A solid die of 2 cm has no audible mode; a hollow box of 50 cm has modes from 100 Hz on (docs/examples/blocks).
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
  of_die.advance(10.0);
  EXPECT_TRUE(of_die.choose(0).has(Effect::kAccelerationNoise) && of_die.choose(0).has(Effect::kAirDelay));
  EXPECT_FALSE(of_die.choose(0).has(Effect::kModal));

  bank::Bank box = make_cube_bank({{100.0, 27.0, 12.0}, {160.0, 30.0, 24.0}, {320.0, 40.0, 60.0}, {700.0, 120.0, 120.0}}, 150.0);
  for (auto& vertex : box.vertices_m)
    for (double& x : vertex) x *= 5.0;
  box.rigid.mass_kg = 19.0;
  stage.body().bank = &box;
  const auto knock = [&] {
    EffectSelector selector(stage.facts);
    selector.watch(make_strike(0.5, 19.0 * 1.5, 2e-3));
    selector.advance(10.0);
    EXPECT_TRUE(selector.choose(0).has(Effect::kModal));
    return std::pair(selector.choose(0).has(Effect::kAccelerationNoise), selector.get_plan(0)[Effect::kAccelerationNoise].reason);
  };
  // Its thump is 10 to 40 dB below its ring: inaudible. A click of a smaller body would be audible at this level.
  EXPECT_FALSE(knock().first);
  EXPECT_EQ(knock().second.rule, SelectionReason::Rule::kThump);
  EXPECT_LT(knock().second.value, -10.0);
  EXPECT_GT(knock().second.value, -40.0);
  // Without a ring the thump is audible.
  for (double& gain : box.radiation_gain) gain *= 1e-3;
  EXPECT_TRUE(knock().first);
  for (double& gain : box.radiation_gain) gain *= 1e3;
  for (auto& vertex : box.vertices_m)
    for (double& x : vertex) x *= 0.25;
  box.rigid.mass_kg /= 64.0;
  EXPECT_TRUE(knock().first);
  EXPECT_EQ(knock().second.rule, SelectionReason::Rule::kChange);
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

// The level of a dipole is 20 log |cos|, uniform over the cosine, cut at -20 dB of its mean power: its standard deviation by quadrature.
TEST(EffectSelector, DirectivityNeedsALevelThatVariesOverDirections) {
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
    selector.advance(10.0);
    const EffectPlan plan = selector.get_plan(0)[Effect::kDirectivity];
    return std::pair(plan.on, plan.reason);
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
  // Next to a body that is 65 dB louder its directivity is inaudible.
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
    selector.advance(10.0);
    EXPECT_TRUE(selector.choose(0).has(Effect::kModal));
    EXPECT_EQ(selector.choose(0).has(Effect::kDirectivity), below_db < 60.0);
    EXPECT_EQ(selector.get_plan(0)[Effect::kDirectivity].reason.rule,
              below_db < 60.0 ? SelectionReason::Rule::kDirected : SelectionReason::Rule::kFaint);
  }
  stage.body().overrides.off = {Effect::kDirectivity};
  EXPECT_FALSE(play_blow(0.01).first);
}

/// Effects by a strike at 0.5 s, and the plan of one of them.
auto select_for_strike(const Stage& stage, double impulse_n_s, Effect effect) {
  EffectSelector selector(stage.facts);
  selector.watch(make_strike(0.5, impulse_n_s));
  selector.advance(10.0);
  return std::pair(selector.choose(0), selector.get_plan(0)[effect]);
}

TEST(EffectSelector, NonlinearMotionNeedsAnAudibleRiseOfAMode) {
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
  // The rise is proportional to the square of the impulse.
  const double just = std::sqrt(kHardeningCents / high.reason.value);
  EXPECT_TRUE(play_strike(1.01 * just).first.has(Effect::kNonlinear));
  const auto [soft, low] = play_strike(0.99 * just);
  EXPECT_FALSE(soft.has(Effect::kNonlinear));
  EXPECT_NEAR(low.reason.value, 0.99 * 0.99 * kHardeningCents, 1e-6);
  EXPECT_EQ(describe(low.reason), "a strike raises a mode by 2.94 cents, less than 3");
  stage.body().overrides.off = {Effect::kNonlinear};
  EXPECT_FALSE(play_strike(1.0).first.has(Effect::kNonlinear));
}

TEST(EffectSelector, ACascadeNeedsAHardStrikeAndModesAbove) {
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
  const auto [soft, low] = play_strike(0.99 * just);
  EXPECT_FALSE(soft.has(Effect::kCascade));
  EXPECT_TRUE(soft.has(Effect::kNonlinear));
  stage.body().overrides.off = {Effect::kNonlinear};
  EXPECT_FALSE(play_strike(1.01 * just).first.has(Effect::kCascade));
}

}  // namespace
}  // namespace carillon::effects
