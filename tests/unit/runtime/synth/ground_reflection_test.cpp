// Ground reflection against closed forms of two paths, with and without directivity.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <vector>

#include "runtime/base/error.hpp"
#include "runtime/synth/floor.hpp"
#include "tests/unit/runtime/synth/directed_scene.hpp"

namespace carillon::synth {
namespace {

using namespace testing;

TEST(GroundReflection, DoublesThePressureOnTheFloor) {
  for (const bool directed : {false, true}) {
    constexpr double kFreq = 1100.0, kRadius = 0.05;
    Scene scene = make_tone(kFreq, make_dipole(1.0), kRadius, {{1.5, 0.4, 0.0}});
    scene.position_m = {0.0, 0.0, 0.7};
    scene.effects = directed ? kDirected : kDefaultEffects;
    const Sound free = play(scene);
    scene.effects = scene.effects.with(Effect::kGroundReflection);
    scene.floor = Floor{};
    const Sound heard = play(scene);
    ASSERT_GT(calc_rms(free[0]), 0.0);
    double worst = 0.0, peak = 0.0;
    for (std::size_t n = 0; n < heard[0].size(); ++n) {
      worst = std::max(worst, std::abs(static_cast<double>(heard[0][n]) - 2.0 * static_cast<double>(free[0][n])));
      peak = std::max(peak, std::abs(static_cast<double>(free[0][n])));
    }
    EXPECT_LT(worst, 1e-5 * peak) << directed;
  }
}

// Two paths differing by odd half waves in the nulls; a vertical floor, and an absorbing one.
TEST(GroundReflection, CombsTheSound) {
  const Vec3 ear{2.0, 0.0, 1.2}, body{0.0, 0.3, 0.8};
  const Floor slanted{.point_m = {0.1, 0.0, -0.4}, .normal = normalise(Vec3{0.2, -0.1, 1.0}), .reflection = 0.6};
  for (const Floor& floor : {Floor{}, slanted}) {
    const double straight = norm(ear - body), mirrored = norm(floor.mirror(ear) - body);
    for (const double halves : {1.0, 2.0, 3.0, 3.5, 5.0}) {
      const double freq = halves * 0.5 * kC / (mirrored - straight), k = 2.0 * pi * freq / kC;
      Scene scene = make_tone(freq, make_monopole(1.0, freq, 1e-3), 1e-3, {ear});
      scene.position_m = body;
      scene.floor = floor;
      const Complex expected = std::polar(1.0 / straight, -k * straight) + floor.reflection * std::polar(1.0 / mirrored, -k * mirrored);
      for (const bool directed : {false, true}) {
        scene.effects = (directed ? kDirected : kDefaultEffects).with(Effect::kGroundReflection);
        const Complex heard = measure(play(scene)[0], freq);
        EXPECT_LT(to_db(std::abs(heard - expected) * straight), -60.0) << halves << directed;
        if (halves == 1.0 && floor.reflection == 1.0) {
          EXPECT_NEAR(std::abs(heard), 1.0 / straight - 1.0 / mirrored, 1e-3);
        }
      }
    }
  }
}

// A dipole radiates differently downwards than towards the ear.
TEST(GroundReflection, UsesTheDownwardRadiation) {
  constexpr double kRadius = 0.05, kFreq = 1700.0, k = 2.0 * pi * kFreq / kC;
  const Vec3 ear{1.0, 0.5, 0.4}, body{0.0, 0.0, 0.9};
  Scene scene = make_tone(kFreq, make_dipole(1.0), kRadius, {ear});
  scene.position_m = body;
  scene.floor = Floor{};
  scene.effects = kDirected.with(Effect::kGroundReflection);
  Complex expected{};
  for (const Vec3& place : {ear, Vec3{ear[0], ear[1], -ear[2]}}) {
    const Vec3 way = place - body;
    expected += std::conj(calc_dipole_fall(k * norm(way), k * kRadius)) * (way[2] / norm(way));
  }
  EXPECT_LT(to_db(std::abs(measure(play(scene)[0], kFreq) - expected) / std::abs(expected)), -60.0);
}

// Walking and rotating listener, and acceleration noise: doubled for ears on the floor.
TEST(GroundReflection, FollowsTheListenerAndReflectsTheClick) {
  Scene scene = make_tone(700.0, make_monopole(1.0, 700.0, 0.01), 0.01, {{-0.1, 0.0, 0.0}, {0.1, 0.0, 0.0}});
  scene.events = {make_blow(3e-4)};
  scene.position_m = {0.3, 0.8, 0.5};
  for (int i = 0; i <= 10; ++i) {
    scene.events.emplace_back(events::Listener{.time_s = 0.01 * i,
                                               .position_m = {0.02 * i, 0.0, 0.0},
                                               .velocity_m_s = {2.0, 0.0, 0.0},
                                               .rotation = turn_about({0, 0, 1}, 0.1 * i)});
  }
  scene.effects = kDefaultEffects.with(Effect::kAccelerationNoise);
  const Sound free = play(scene);
  scene.effects = scene.effects.with(Effect::kGroundReflection);
  scene.floor = Floor{};
  const Sound heard = play(scene);
  for (std::size_t e = 0; e < 2; ++e) {
    std::vector<float> twice(free[e]);
    for (float& p : twice) p *= 2.0F;
    EXPECT_LT(calc_difference_db(heard[e], twice), -100.0);
  }
}

TEST(GroundReflection, RefusesImpossibleFloors) {
  const auto model = Model::make(make_cube_bank({{400.0, 5.0}}), {.rate_hz = kRate});
  Synthesiser without({.rate_hz = kRate});
  EXPECT_THROW(without.add_body(model, {.effects = kDefaultEffects.with(Effect::kGroundReflection)}), InputError);
  SynthesiserOptions options{.rate_hz = kRate};
  options.floor = Floor{.point_m = {0.0, 0.0, 0.5}};
  EXPECT_THROW(Synthesiser{options}, InputError);  // ears below
  options.floor = Floor{.normal = {0.0, 0.0, 2.0}};
  EXPECT_THROW(Synthesiser{options}, InputError);
  options.floor = Floor{.reflection = 1.5};
  EXPECT_THROW(Synthesiser{options}, InputError);
}

TEST(GroundReflection, DoesNoWorkWhenOff) {
  Scene scene = make_gains_scene();
  scene.effects = kDefaultEffects;
  scene.floor = Floor{.point_m = {0.0, 0.0, -1.0}};
  EffectCounters off, on;
  play(scene, &off);
  scene.effects = kDefaultEffects.with(Effect::kGroundReflection);
  play(scene, &on);
  EXPECT_EQ(off.units[Effect::kGroundReflection], 0);
  EXPECT_GT(on.units[Effect::kGroundReflection], 0);
  EXPECT_EQ(on.units[Effect::kAirDelay], off.units[Effect::kAirDelay]);
}

}  // namespace
}  // namespace carillon::synth