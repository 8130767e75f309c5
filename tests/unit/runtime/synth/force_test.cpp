// Forces known step by step, against the closed form of modes (that of the impact stage, which shares no code) and whole impacts.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <numeric>
#include <random>
#include <vector>

#include "runtime/physics/impact/impact.hpp"
#include "runtime/synth/acceleration_noise.hpp"
#include "runtime/synth/resonator_bank.hpp"
#include "runtime/synth/synthesiser.hpp"
#include "tests/unit/runtime/physics/impact/scenes.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::synth {
namespace {

using events::Force;
using testing::InventedMode;
using testing::make_cube_bank;
constexpr double kRate = 48000.0, kPi = std::numbers::pi;

/// Force of a whole pulse, mesh axes.
struct Course {
  double begin_s = 0.0, step_s = 0.0;
  std::vector<Vec3> impulses;
};

std::vector<Force> make_pieces(const Course& course, std::int32_t triangle = 0, const Vec3& barycentric = {1.0, 0.0, 0.0}) {
  std::vector<Force> pieces;
  events::split_force({.time_s = course.begin_s, .step_s = course.step_s, .triangle = triangle, .barycentric = barycentric},
                      course.impulses, [&](const Force& piece) { pieces.push_back(piece); });
  return pieces;
}

/// Sum of gain q' at every sample, in double precision, by exact maps between borders of steps and samples.
std::vector<double> calc_sound(const bank::Bank& bank, const std::vector<Course>& courses, std::size_t samples) {
  const std::size_t modes = bank.mode_count();
  std::vector<double> omega, q(modes), v(modes), sound;
  for (const double lambda : bank.eigenvalue_rad2_s2) omega.push_back(std::sqrt(lambda));
  std::vector<double> borders;
  for (std::size_t n = 0; n < samples; ++n) borders.push_back(static_cast<double>(n) / kRate);
  for (const Course& c : courses)
    for (std::size_t k = 0; k <= c.impulses.size(); ++k) borders.push_back(c.begin_s + static_cast<double>(k) * c.step_s);
  std::sort(borders.begin(), borders.end());
  double now = 0.0;
  for (const double border : borders) {
    const double h = border - now;
    if (h > 0.0) {
      const impact::Propagator p = impact::make_propagator(omega, bank.decay_per_s, h);
      Vec3 force{};
      for (const Course& c : courses) {
        const double at = std::floor((now + 0.5 * h - c.begin_s) / c.step_s);
        if (!(at >= 0.0 && at < static_cast<double>(c.impulses.size()))) continue;
        for (std::size_t axis = 0; axis < 3; ++axis) force[axis] += c.impulses[at][axis] / c.step_s;
      }
      for (std::size_t m = 0; m < modes; ++m) {
        double f = 0.0;  // at vertex 0
        for (std::size_t axis = 0; axis < 3; ++axis) f += bank.shape_scale[m] * bank.shape[m * 3 + axis] * force[axis];
        const double before = q[m];
        q[m] = p.a[m] * before + p.b[m] * v[m] + p.g[m] * f;
        v[m] = p.c[m] * before + p.e[m] * v[m] + p.b[m] * f;
      }
      now = border;
    }
    if (sound.size() < samples && border >= static_cast<double>(sound.size()) / kRate)
      sound.push_back(std::inner_product(v.begin(), v.end(), bank.radiation_gain.begin(), 0.0));
  }
  return sound;
}

std::vector<float> play(ResonatorBank& voice, std::size_t samples, std::size_t block = 256) {
  std::vector<float> pressure(samples, 0.0F);
  for (std::size_t n = 0; n < samples; n += block) voice.process(std::span(pressure).subspan(n, std::min(block, samples - n)));
  return pressure;
}

/// Relative root mean square difference.
double calc_error(const std::vector<float>& heard, const std::vector<double>& expected) {
  double difference = 0.0, size = 0.0;
  for (std::size_t n = 0; n < expected.size(); ++n) {
    const double d = heard[n] - expected[n];
    difference += d * d;
    size += expected[n] * expected[n];
  }
  return std::sqrt(difference / size);
}

/// Strike at vertex 0 in triangle 0.
std::vector<InventedMode> make_modes(int count) {
  std::vector<InventedMode> modes;
  std::mt19937_64 random(7);
  for (int m = 0; m < count; ++m) {
    const double turn = 0.37 * m;
    modes.push_back({40.0 * std::pow(560.0, static_cast<double>(m) / count), 0.5 + 3.0 * m, 1.0, {std::cos(turn), std::sin(turn), 0.5}});
  }
  return modes;
}

Course make_course(double begin_s, double step_s, std::size_t steps, bool rubs) {
  Course course{begin_s, step_s, {}};
  for (std::size_t k = 0; k < steps; ++k) {
    const double x = (static_cast<double>(k) + 0.5) / static_cast<double>(steps), force = std::pow(std::sin(kPi * x), 1.5);
    const double along = rubs ? -0.3 * std::cos(5.0 * x) : 0.0, across = rubs ? 0.2 * std::sin(9.0 * x) : 0.0;
    const auto single = [](double value) { return static_cast<double>(static_cast<float>(value)); };
    course.impulses.push_back({single(step_s * force * along), single(step_s * force * across), single(step_s * force)});
  }
  return course;
}

TEST(Force, IsAnsweredExactlyByModesOfAllKinds) {
  struct Case {
    double begin_s, step_s;
    std::size_t steps;
    bool rubs;
    const char* name;
  };
  const std::vector<Case> cases{{1.00013e-3, 3.7e-6, 27, false, "Hertz-like, between samples"},
                                {1.00013e-3, 3.7e-6, 27, true, "that rubs"},
                                {1.0 / 48000.0, 2.0e-5, 1, false, "one step"},
                                {7.7e-3, 1.0e-5, 1300, true, "13 ms, 82 pieces"},
                                {0.3e-3, 1.0 / 48000.0, 64, true, "steps as long as samples"},
                                {0.3e-3, 3.1e-4, 20, true, "steps of many samples"},
                                {0.3e-3, 1.1e-9, 30, true, "steps far below a sample"}};
  const bank::Bank bank = make_cube_bank(make_modes(40));
  for (const Case& c : cases) {
    const Course course = make_course(c.begin_s, c.step_s, c.steps, c.rubs);
    ResonatorBank voice(Model::make(bank, {.rate_hz = kRate}), {.silence_pa = 1e-30});
    for (const Force& piece : make_pieces(course)) ASSERT_TRUE(voice.push(piece)) << c.name;
    const double error = calc_error(play(voice, 2400, 61), calc_sound(bank, {course}, 2400));
    EXPECT_LT(error, 1e-6) << c.name;
    std::printf("%s: %.2g\n", c.name, error);
    EXPECT_EQ(voice.get_counters().late, 0);
  }
}

TEST(Force, IsAnsweredByModesNearAndAboveCriticalDamping) {
  for (const double share : {0.9, 0.9999, 1.0, 1.2, 30.0, 3000.0}) {
    bank::Bank bank = make_cube_bank({{2000.0, 0.0, 1.0, {0.3, -0.2, 1.0}}});
    bank.decay_per_s[0] = share * 2.0 * kPi * 2000.0;
    for (const double step_s : {3.7e-6, 5.0e-5}) {
      const Course course = make_course(1.00013e-3, step_s, 40, true);
      ResonatorBank voice(Model::make(bank, {.rate_hz = kRate}), {.silence_pa = 1e-30});
      for (const Force& piece : make_pieces(course)) ASSERT_TRUE(voice.push(piece));
      EXPECT_LT(calc_error(play(voice, 480), calc_sound(bank, {course}, 480)), share > 1000.0 ? 1e-3 : 1e-6) << share << " " << step_s;
    }
  }
}

TEST(Force, OfNoLengthIsAnImpulse) {
  const bank::Bank bank = make_cube_bank(make_modes(30));
  for (const double step_s : {1e-300, 1e-20, 1e-13}) {
    for (const double begin_s : {1e-3, 1.00007e-3, 48.0 / kRate}) {
      Force force = make_pieces(make_course(begin_s, step_s, 16, false)).front();
      for (auto& j : force.impulse_n_s) j = {0.0F, 0.0F, 1e-3F};
      ResonatorBank by_force(Model::make(bank, {.rate_hz = kRate})), by_impulse(Model::make(bank, {.rate_hz = kRate}));
      ASSERT_TRUE(by_force.push(force));
      ASSERT_TRUE(by_impulse.strike({.time_s = begin_s, .impulse_n_s = {0.0, 0.0, 16e-3}}));
      std::vector<float> expected = play(by_impulse, 480), heard = play(by_force, 480);
      heard[48] = expected[48] = 0.0F;  // an impulse at a sample is audible there, a force beginning there is not yet
      EXPECT_LT(calc_error(heard, std::vector<double>(expected.begin(), expected.end())), 1e-5) << step_s << " " << begin_s;
    }
  }
}

TEST(Force, AThousandAtOnceAddUp) {
  const bank::Bank bank = make_cube_bank(make_modes(20));
  ResonatorBank voice(Model::make(bank, {.rate_hz = kRate}), {.max_forces = 1000, .silence_pa = 1e-30});
  std::vector<Course> courses;
  for (int i = 0; i < 1000; ++i) {
    courses.push_back(make_course(1e-3 + 1.37e-6 * i, 3e-6 + 1e-8 * i, 16, i % 2 == 0));
    ASSERT_TRUE(voice.push(make_pieces(courses.back()).front())) << i;
  }
  EXPECT_LT(calc_error(play(voice, 480), calc_sound(bank, courses, 480)), 1e-6);
  EXPECT_EQ(voice.get_counters().accepted, 1000);
}

TEST(Force, SoundsTheSameInBlocksOfAnySizeAndOnAnyInstructionSetToRounding) {
  const bank::Bank bank = make_cube_bank(make_modes(33));
  const Course course = make_course(2.1e-3, 1.3e-5, 300, true);
  std::vector<float> first;
  for (const Isa isa : base::list_instructions()) {
    std::vector<float> own;
    for (const std::size_t block : {1U, 31U, 128U, 1000U}) {
      ResonatorBank voice(Model::make(bank, {.rate_hz = kRate}), {.isa = isa});
      for (const Force& piece : make_pieces(course)) ASSERT_TRUE(voice.push(piece));
      const std::vector<float> heard = play(voice, 2000, block);
      if (own.empty()) own = heard;
      EXPECT_EQ(heard, own) << block;
    }
    if (first.empty()) first = own;
    EXPECT_LT(calc_error(own, std::vector<double>(first.begin(), first.end())), 1e-6);
  }
}

TEST(Force, UnplayableForcesAreRefused) {
  const bank::Bank bank = make_cube_bank(make_modes(5));
  ResonatorBank voice(Model::make(bank, {.rate_hz = kRate}), {.max_forces = 4});
  AccelerationNoise click(0.05, 1.0, kRate, 2, 4);
  const Force good = make_pieces(make_course(1e-3, 1e-5, 10, true)).front();
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  std::vector<Force> bad(6, good);
  bad[0].impulse_n_s[3][1] = static_cast<float>(kNan);
  bad[1].time_s = kNan;
  bad[2].step_s = 0.0;
  bad[3].step_s = kNan;
  bad[4].count = 17;
  bad[5].count = 0;
  for (const Force& force : bad) {
    EXPECT_FALSE(voice.push(force));
    EXPECT_FALSE(click.push(force, {1.0, 0.0, 0.0, 0.0}));
  }
  Force outside = good;
  outside.triangle = 12;
  EXPECT_FALSE(voice.push(outside));
  for (int i = 0; i < 4; ++i) {
    EXPECT_TRUE(voice.push(good));
    EXPECT_TRUE(click.push(good, {1.0, 0.0, 0.0, 0.0}));
  }
  EXPECT_FALSE(voice.push(good)) << "no room";
  EXPECT_FALSE(click.push(good, {1.0, 0.0, 0.0, 0.0}));
  EXPECT_EQ(voice.get_counters().refused, 8);
  Force nothing = good;
  nothing.impulse_n_s = {};
  ResonatorBank still(Model::make(bank, {.rate_hz = kRate}));
  EXPECT_TRUE(still.push(nothing));
  EXPECT_TRUE(still.is_idle()) << "no force, no work";
}

TEST(Force, LateForcesKeepTheirImpulse) {
  const bank::Bank bank = make_cube_bank({{50.0, 0.0}});
  ResonatorBank voice(Model::make(bank, {.rate_hz = kRate}));
  play(voice, 4800);
  const Course course = make_course(0.01, 1e-5, 10, false);
  ASSERT_TRUE(voice.push(make_pieces(course).front()));
  EXPECT_EQ(voice.get_counters().late, 1);
  double sum = 0.0;
  for (const auto& j : course.impulses) sum += j[2];
  EXPECT_NEAR(play(voice, 64).back(), sum, 0.15 * sum) << "a 25th of a period later";
}

TEST(Force, LatePiecesAreShiftedTogether) {
  const bank::Bank bank = make_cube_bank(make_modes(20));
  const Course late = make_course(0.01, 2e-5, 100, false), other = make_course(0.01, 3e-5, 60, false);
  ResonatorBank voice(Model::make(bank, {.rate_hz = kRate})), in_time(Model::make(bank, {.rate_hz = kRate}));
  play(voice, 4800);
  play(in_time, 4800);
  // Pieces of two pulses take turns; the last one comes when it would no longer be late.
  const std::vector<Force> first = make_pieces(late), second = make_pieces(other, 1);
  for (std::size_t k = 0; k < first.size(); ++k) {
    ASSERT_TRUE(voice.push(first[k]));
    if (k < second.size()) {
      ASSERT_TRUE(voice.push(second[k]));
    }
  }
  EXPECT_EQ(voice.get_counters().late, 2) << "pulses";
  for (const Course* course : {&late, &other}) {
    Course shifted = *course;
    shifted.begin_s = 4799.0001 / kRate;
    for (const Force& piece : make_pieces(shifted, course == &late ? 0 : 1)) ASSERT_TRUE(in_time.push(piece));
  }
  EXPECT_EQ(in_time.get_counters().late, 0);
  const auto wanted = play(in_time, 2400);
  EXPECT_LT(calc_error(play(voice, 2400), std::vector<double>(wanted.begin(), wanted.end())), 1e-3);
}

TEST(Force, MovesAClickAsTheSamePulseInOnePiece) {
  // A Hertz pulse in 4,000 steps.
  constexpr double kLength = 1.3e-3, kBegin = 2.01e-3;
  Course course = make_course(kBegin, kLength / 4000.0, 4000, false);
  const double sum = std::accumulate(course.impulses.begin(), course.impulses.end(), 0.0, [](double s, const auto& j) { return s + j[2]; });
  for (auto& j : course.impulses) j = {0.6e-3 * j[2] / sum, 0.0, -0.8e-3 * j[2] / sum};
  // The smallest body follows the slope of the force, which steps lack.
  for (const double radius : {0.0005, 0.02, 0.2}) {
    const events::Quaternion turned{std::sqrt(0.5), 0.0, 0.0, std::sqrt(0.5)};
    AccelerationNoise by_steps(radius, 0.3, kRate, 1, 300), by_pulse(radius, 0.3, kRate);
    for (const Force& piece : make_pieces(course)) ASSERT_TRUE(by_steps.push(piece, turned));
    ASSERT_TRUE(by_pulse.strike({.time_s = kBegin + 0.5 * kLength, .impulse_n_s = {0.6e-3, 0.0, -0.8e-3}, .duration_s = kLength}, turned));
    std::array<std::vector<float>, 3> a, b;
    for (auto* sound : {&a, &b})
      for (auto& axis : *sound) axis.assign(600, 0.0F);
    by_steps.process({std::span(a[0]), std::span(a[1]), std::span(a[2])});
    by_pulse.process({std::span(b[0]), std::span(b[1]), std::span(b[2])});
    for (const std::size_t axis : {1U, 2U})
      EXPECT_LT(calc_error(a[axis], std::vector<double>(b[axis].begin(), b[axis].end())), radius < 1e-3 ? 5e-3 : 1e-4) << radius;
  }
}

/// Ball on a plate, with and without friction: the modes after the impact are those of the world.
TEST(Force, OfAWholeImpactLeavesTheModesOfTheWorld) {
  for (const double friction : {0.0, 0.3}) {
    const impact::tests::Plate plate = impact::tests::make_plate(0.5, 0.4, 0.006, 19000.0, 0.21, 0.17, 4.0);
    bank::Bank bank = make_cube_bank(std::vector<InventedMode>(plate.omega.size(), {1000.0, 4.0}));
    std::vector<double> shape;
    for (std::size_t m = 0; m < plate.omega.size(); ++m) {
      bank.eigenvalue_rad2_s2[m] = plate.omega[m] * plate.omega[m];
      const double phi = plate.shape[3 * m + 2];
      bank.shape_scale[m] = std::abs(phi) / 32767.0;
      // Something along the plate too, for the friction.
      const std::array<std::int16_t, 3> steps{static_cast<std::int16_t>(friction > 0.0 ? 3000 : 0), 0,
                                              static_cast<std::int16_t>(phi < 0.0 ? -32767 : 32767)};
      for (std::size_t axis = 0; axis < 3; ++axis) {
        bank.shape[3 * m + axis] = steps[axis];
        shape.push_back(bank.shape_scale[m] * steps[axis]);
      }
    }
    const impact::Modes modes(plate.omega, plate.decay);
    impact::Body ball = impact::tests::make_ball(0.01, {friction > 0.0 ? 0.4 : 0.0, 0.0, -1.0}), struck;
    struck.modes = &modes;
    impact::Contact contact = impact::tests::make_contact(0.01, 0, 1);
    contact.shape_b = shape;
    contact.friction = friction;
    impact::Impact impact({ball, struck}, {contact});
    ASSERT_TRUE(impact.advance(0.05));
    const double end_s = impact.get_time();
    impact::Body after = impact.get_bodies()[1];
    constexpr double kBegin = 0.0030041;
    ResonatorBank voice(Model::make(bank, {.rate_hz = kRate}), {.silence_pa = 1e-30});
    for (const impact::Pulse& pulse : impact.take_pulses()) {
      Course course{kBegin + pulse.start_s, pulse.step_s, {}};
      for (const Vec3& j : pulse.impulse_n_s) course.impulses.push_back({-j[0], -j[1], -j[2]});
      for (const Force& piece : make_pieces(course)) ASSERT_TRUE(voice.push(piece));
    }
    // All modes at once, from when the impact is over: velocities, then the energy at the end of a block.
    constexpr std::size_t kSamples = 128 * 40;
    const std::vector<float> heard = play(voice, kSamples);
    const std::size_t first = std::ceil((kBegin + end_s) * kRate);
    modes.move_freely(after.q, after.q_dot, static_cast<double>(first) / kRate - kBegin - end_s);
    std::vector<double> expected;
    std::vector<float> rest;
    for (std::size_t n = first; n < kSamples; ++n) {
      expected.push_back(std::accumulate(after.q_dot.begin(), after.q_dot.end(), 0.0));
      rest.push_back(heard[n]);
      modes.move_freely(after.q, after.q_dot, 1.0 / kRate);
    }
    const double error = calc_error(rest, expected), energy = modes.calc_energy(after.q, after.q_dot);
    EXPECT_LT(error, 1e-6) << friction;
    EXPECT_NEAR(voice.calc_energy_j(), energy, 1e-6 * energy) << friction;
    std::printf("whole impact, friction %.1f: output %.2g, energy %.2g\n", friction, error, voice.calc_energy_j() / energy - 1.0);
  }
}

/// Audibility floor: a pulse in pieces wakes the groups of the whole pulse.
TEST(Force, InPiecesWakesTheSameGroups) {
  std::vector<InventedMode> modes = make_modes(200);
  for (std::size_t m = 0; m < modes.size(); ++m) modes[m].gain = std::pow(0.95, static_cast<double>(m));
  const auto model = Model::make(make_cube_bank(modes), {.rate_hz = kRate});
  const Course course = make_course(1e-3, 1e-5, 160, false);
  double sum = 0.0;
  for (const auto& j : course.impulses) sum += j[2];
  for (const float floor_pa : {1e-6F, 1e-5F, 1e-4F}) {
    ResonatorBank whole(model), pieces(model);
    whole.set_floor(floor_pa);
    pieces.set_floor(floor_pa);
    ASSERT_TRUE(whole.strike({.time_s = 1.8e-3, .impulse_n_s = {0.0, 0.0, sum}, .duration_s = 1.6e-3}));
    for (const Force& piece : make_pieces(course)) ASSERT_TRUE(pieces.push(piece));
    play(whole, 128);
    play(pieces, 128);
    EXPECT_EQ(pieces.get_ringing_group_count(), whole.get_ringing_group_count()) << floor_pa;
    EXPECT_LT(pieces.get_ringing_group_count(), pieces.get_group_count());
  }
}

/// The model is swapped for an equal one during a long force, with acceleration noise.
TEST(Force, ContinuesWhenTheBodyIsExchanged) {
  const bank::Bank bank = make_cube_bank(make_modes(20));
  const Course course = make_course(5e-3, 1e-5, 1300, true);
  const auto listen = [&](bool swaps) {
    Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{0, 0, 0}}, .listener_m = {0, 1, 0}});
    const int body =
        synthesiser.add_body(Model::make(bank, {.rate_hz = kRate}), {.effects = kDefaultEffects.with(Effect::kAccelerationNoise)});
    for (const Force& piece : make_pieces(course)) EXPECT_TRUE(synthesiser.push(piece));
    std::vector<float> sound(4800);
    for (std::size_t n = 0; n < sound.size(); n += 96) {
      if (swaps && n == 480) synthesiser.swap_model(body, Model::make(bank, {.rate_hz = kRate}));
      if (n % 960 == 0) synthesiser.collect();
      float* out = sound.data() + n;
      synthesiser.process(&out, 1, 96);
    }
    EXPECT_EQ(synthesiser.get_counters().refused, 0);
    return sound;
  };
  const std::vector<float> alone = listen(false), swapped = listen(true);
  EXPECT_LT(calc_error(swapped, std::vector<double>(alone.begin(), alone.end())), 1e-4);
}

TEST(Force, ReachesASynthesiserAsAResonatorBank) {
  const bank::Bank bank = make_cube_bank(make_modes(20));
  const Course course = make_course(2.0e-3, 1.1e-5, 40, true);
  const auto listen = [&](EffectSet effects, bool as_impulses) {
    Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{0, 0, 0}}, .listener_m = {0, 1, 0}});
    const int body = synthesiser.add_body(Model::make(bank, {.rate_hz = kRate}), {.effects = effects});
    for (Force piece : make_pieces(course)) {
      piece.body = body;
      EXPECT_TRUE(synthesiser.push(as_impulses ? events::Event(events::to_impulse(piece)) : events::Event(piece)));
    }
    std::vector<float> sound(4800);
    for (std::size_t n = 0; n < sound.size(); n += 96) {
      float* out = sound.data() + n;
      synthesiser.process(&out, 1, 96);
    }
    EXPECT_EQ(synthesiser.get_counters().strikes, as_impulses ? 3 : 1);
    EXPECT_EQ(synthesiser.get_effect_counters(body).units[Effect::kHertzPulse], effects.has(Effect::kHertzPulse) && !as_impulses ? 3 : 0);
    return sound;
  };
  const EffectSet all{Effect::kModal, Effect::kHertzPulse, Effect::kAccelerationNoise};
  const std::vector<float> whole = listen(all, false), at_once = listen(all.without(Effect::kHertzPulse), false);
  EXPECT_GT(*std::max_element(whole.begin(), whole.end()), 0.0F);
  EXPECT_NE(whole, at_once);
  EXPECT_EQ(at_once, listen(all.without(Effect::kHertzPulse), true)) << "without the length of pulses a piece is an impulse";
  // Without room for forces they are refused.
  Synthesiser roomy({.rate_hz = kRate, .max_forces = 200});
  const int without = roomy.add_body(Model::make(bank, {.rate_hz = kRate}), {.max_forces = 0});
  Force piece = make_pieces(course).front();
  piece.body = without;
  EXPECT_TRUE(roomy.push(piece));
  roomy.process(nullptr, 0, 0);
  EXPECT_EQ(roomy.get_counters().refused, 1);
  Synthesiser synthesiser({.rate_hz = kRate});
  Force bad = make_pieces(course).front();
  bad.impulse_n_s[0][0] = std::numeric_limits<float>::quiet_NaN();
  EXPECT_FALSE(synthesiser.push(bad));
  EXPECT_EQ(synthesiser.get_counters().faults, 1);
}

}  // namespace
}  // namespace carillon::synth
