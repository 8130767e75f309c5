#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <functional>
#include <numbers>
#include <vector>

#include "runtime/base/error.hpp"
#include "runtime/synth/synthesiser.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::synth {
namespace {

using std::numbers::pi;
constexpr double kRate = 48000.0;
constexpr EffectSet kHere{Effect::kModal,    Effect::kHertzPulse, Effect::kAccelerationNoise,
                          Effect::kAirDelay, Effect::kDoppler,    Effect::kTwoEars};

std::shared_ptr<const Model> make_model(const std::vector<testing::InventedMode>& modes) {
  return Model::make(testing::make_cube_bank(modes), {.rate_hz = kRate});
}

events::Impulse make_impulse(int body, double time_s) {
  return {.time_s = time_s, .body = body, .impulse_n_s = {0.0, 0.0, 1.0}, .duration_s = 2e-4};
}

/// Plays and appends to the channels.
void play(Synthesiser& synthesiser, std::vector<std::vector<float>>& out, int frames, int block = 128) {
  const std::size_t channels = synthesiser.get_microphone_count();
  out.resize(channels);
  for (int done = 0; done < frames;) {
    const int count = std::min(block, frames - done);
    std::vector<float*> at;
    for (auto& channel : out) {
      channel.resize(channel.size() + static_cast<std::size_t>(count));
      at.push_back(channel.data() + channel.size() - static_cast<std::size_t>(count));
    }
    synthesiser.process(at.data(), static_cast<int>(channels), count);
    done += count;
  }
}

double find_peak(const std::vector<float>& x, std::size_t from, std::size_t to) {
  double peak = 0.0;
  for (std::size_t n = from; n < to; ++n) peak = std::max(peak, std::abs(static_cast<double>(x[n])));
  return peak;
}

// One effect is taken away at a time: it does nothing and holds nothing, and all the others do something.
TEST(BodyEffects, WhatIsOffExecutesNothingAndHoldsNothing) {
  const auto model = make_model({{400.0, 5.0}, {3000.0, 8.0}});
  for (int off = -1; off < kEffectCount; ++off) {
    const EffectSet effects = off < 0 ? kHere : kHere.without(static_cast<Effect>(off));
    Synthesiser synthesiser({.rate_hz = kRate});
    const int body = synthesiser.add_body(model, {.position_m = {0.0, 2.0, 0.0}, .effects = effects});
    synthesiser.push(make_impulse(body, 0.01));
    synthesiser.push(events::BodyMotion{0.0, body, {0.0, 2.0, 0.0}, {3.0, 0.0, 0.0}});
    synthesiser.push(events::BodyMotion{0.2, body, {0.6, 2.0, 0.0}, {3.0, 0.0, 0.0}});
    std::vector<std::vector<float>> out;
    play(synthesiser, out, 9600);
    const EffectCounters counters = synthesiser.get_effect_counters(body);
    for (int e = 0; e < kEffectCount; ++e) {
      const auto effect = static_cast<Effect>(e);
      const bool needs_delay = effect == Effect::kDoppler && !effects.has(Effect::kAirDelay);
      if (effects.has(effect) && !needs_delay) {
        EXPECT_GT(counters.units[effect], 0) << get_name(effect) << " without " << off;
      } else {
        EXPECT_EQ(counters.units[effect], 0) << get_name(effect) << " without " << off;
        EXPECT_EQ(counters.bytes[effect], 0) << get_name(effect) << " without " << off;
      }
      EXPECT_EQ(counters.ticks[effect], 0);
    }
    if (effects.has(Effect::kHertzPulse)) {
      EXPECT_EQ(counters.units[Effect::kHertzPulse], 1);
    }
    if (effects.has(Effect::kAirDelay)) {
      EXPECT_GT(counters.bytes[Effect::kAirDelay], 4 * 8000);  // 60 m
    }
    if (effects.has(Effect::kTwoEars) && off < 0) {
      EXPECT_EQ(2 * counters.units[Effect::kTwoEars], counters.units[Effect::kAirDelay]);
    }
  }
}

// A 400 Hz tone from 17.15 m: 20 of its blocks late. So with and without delay it is the same, before, while and after it changes.
TEST(BodyEffects, AirDelayComesAndGoesWithoutAGapOrAClick) {
  Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{0.0, 0.0, 0.0}}});
  constexpr double kDistance = 17.15;
  const int body = synthesiser.add_body(make_model({{400.0, 0.0, 2.0}}), {.position_m = {0.0, kDistance, 0.0}});
  events::Impulse impulse = make_impulse(body, 480.0 / kRate);
  impulse.duration_s = 0.0;
  synthesiser.push(impulse);
  std::vector<std::vector<float>> out;
  play(synthesiser, out, 6000);
  const std::int64_t delay_bytes = synthesiser.get_effect_counters(body).bytes[Effect::kAirDelay];
  EXPECT_GT(delay_bytes, 0);
  for (int turn = 0; turn < 2; ++turn) {
    synthesiser.set_effects(body, kDefaultEffects.without(Effect::kAirDelay));
    play(synthesiser, out, 4000, 100);
    synthesiser.collect();
    EXPECT_EQ(synthesiser.get_effect_counters(body).bytes[Effect::kAirDelay], 0);
    const std::int64_t units = synthesiser.get_effect_counters(body).units[Effect::kAirDelay];
    synthesiser.set_effects(body, kDefaultEffects);
    play(synthesiser, out, 6000, 96);
    synthesiser.collect();
    EXPECT_EQ(synthesiser.get_effect_counters(body).bytes[Effect::kAirDelay], delay_bytes);
    EXPECT_GT(synthesiser.get_effect_counters(body).units[Effect::kAirDelay], units);
  }
  for (std::size_t n = 3200; n < out[0].size(); ++n) {
    const double t = (static_cast<double>(n) - 480.0 - Synthesiser::kLatency) / kRate;
    ASSERT_NEAR(out[0][n], 2.0 / kDistance * std::cos(2 * pi * 400.0 * t), 1e-3 * 2.0 / kDistance) << n;
  }
}

// Whatever is switched, the second difference of a low tone stays small; a jump of the tone would be 300 times as large.
TEST(BodyEffects, NoChangeClicks) {
  const EffectSet all = kHere;
  const std::vector<EffectSet> sets{all,
                                    all.without(Effect::kTwoEars),
                                    all.without(Effect::kDoppler),
                                    all.without(Effect::kAirDelay),
                                    all.without(Effect::kAccelerationNoise),
                                    all.without(Effect::kModal),
                                    {Effect::kModal},
                                    {}};
  constexpr double kFreq = 300.0;
  const double omega = 2 * pi * kFreq / kRate;
  for (std::size_t from = 0; from < sets.size(); ++from) {
    for (std::size_t to = 0; to < sets.size(); ++to) {
      Synthesiser synthesiser({.rate_hz = kRate});
      const int body = synthesiser.add_body(make_model({{kFreq, 1.0, 20.0}}), {.position_m = {1.3, 2.0, 0.0}, .effects = sets[from]});
      events::Impulse impulse = make_impulse(body, 0.01);
      impulse.duration_s = 5e-3;
      synthesiser.push(impulse);
      std::vector<std::vector<float>> out;
      play(synthesiser, out, 4800);
      synthesiser.set_effects(body, sets[to]);
      play(synthesiser, out, 4800);
      const double peak = std::max(find_peak(out[0], 2400, 9600), find_peak(out[1], 2400, 9600));
      for (const auto& channel : out) {
        for (std::size_t n = 2400; n + 1 < channel.size(); ++n) {
          const double bend = std::abs(channel[n - 1] - 2.0 * channel[n] + channel[n + 1]);
          ASSERT_LE(bend, 3.0 * omega * omega * peak + 1e-9) << from << " to " << to << " at " << n;
        }
      }
      const bool sounds = sets[to].has(Effect::kModal) && sets[from].has(Effect::kModal);
      EXPECT_EQ(find_peak(out[0], 9000, 9600) > 0.01, sounds) << from << " to " << to;
    }
  }
}

TEST(BodyEffects, WhatIsTakenAwayGivesItsMemoryBackAndCanComeAgain) {
  Synthesiser synthesiser({.rate_hz = kRate});
  const int body = synthesiser.add_body(make_model({{500.0, 3.0}}), {.position_m = {0.0, 2.0, 0.0}, .effects = kHere});
  std::vector<std::vector<float>> out;
  synthesiser.push(make_impulse(body, 0.01));
  play(synthesiser, out, 4800);
  const EffectBytes held = synthesiser.get_effect_counters(body).bytes;
  synthesiser.set_effects(body, {});
  EXPECT_EQ(synthesiser.get_effects(body), EffectSet{});
  play(synthesiser, out, 1000);
  synthesiser.collect();
  EXPECT_EQ(synthesiser.get_effect_counters(body).bytes, EffectBytes{});
  const EffectCounters before = synthesiser.get_effect_counters(body);
  EXPECT_FALSE(synthesiser.push(make_impulse(-1, 0.2)));
  EXPECT_TRUE(synthesiser.push(make_impulse(body, 0.13)));
  play(synthesiser, out, 4000);
  EXPECT_EQ(synthesiser.get_effect_counters(body).units, before.units);
  EXPECT_EQ(find_peak(out[0], 6000, 9800), 0.0);
  synthesiser.set_effects(body, kHere);
  play(synthesiser, out, 200);
  synthesiser.collect();
  EXPECT_EQ(synthesiser.get_effect_counters(body).bytes, held);
  EXPECT_TRUE(synthesiser.push(make_impulse(body, 0.22)));
  play(synthesiser, out, 4800);
  EXPECT_GT(find_peak(out[0], 10800, 14800), 0.5 * find_peak(out[0], 0, 4800));
  synthesiser.remove_body(body);
  play(synthesiser, out, 256);
  synthesiser.collect();
  EXPECT_EQ(synthesiser.get_effect_counters(body).bytes, EffectBytes{});
}

TEST(BodyEffects, OfSeveralChangesAtOnceTheLastOneStays) {
  Synthesiser synthesiser({.rate_hz = kRate});
  const int body = synthesiser.add_body(make_model({{500.0, 3.0}}), {.position_m = {0.0, 2.0, 0.0}});
  synthesiser.set_effects(body, {Effect::kModal});
  synthesiser.set_effects(body, kHere);
  synthesiser.set_effects(body, {Effect::kModal, Effect::kTwoEars});
  EXPECT_EQ(synthesiser.get_effects(body), (EffectSet{Effect::kModal, Effect::kTwoEars}));
  std::vector<std::vector<float>> out;
  for (int i = 0; i < 4; ++i) {
    play(synthesiser, out, 256);
    synthesiser.collect();
  }
  const EffectBytes bytes = synthesiser.get_effect_counters(body).bytes;
  for (int e = 0; e < kEffectCount; ++e) {
    const auto effect = static_cast<Effect>(e);
    EXPECT_EQ(bytes[effect] > 0, effect == Effect::kModal || effect == Effect::kTwoEars) << get_name(effect);
  }
}

TEST(BodyEffects, ChangesGiveTheSameBitsInBlocksOfAnySize) {
  const auto play_all = [](int block) {
    Synthesiser synthesiser({.rate_hz = kRate});
    const auto model = make_model({{300.0, 2.0, 1.0}, {2100.0, 4.0, 0.5}});
    for (int b = 0; b < 3; ++b) synthesiser.add_body(model, {.position_m = {1.0 + b, 2.0, 0.5}});
    std::vector<std::vector<float>> out;
    const std::vector<EffectSet> sets{
        kHere, {Effect::kModal, Effect::kAirDelay}, {}, kHere.without(Effect::kDoppler), kHere.without(Effect::kTwoEars)};
    for (int turn = 0; turn < 10; ++turn) {
      for (int b = 0; b < 3; ++b) {
        const double now = 2400.0 * turn / kRate;
        synthesiser.push(make_impulse(b, now + 0.011 + 0.003 * b));
        synthesiser.push(events::BodyMotion{now, b, {1.0 + b + 0.1 * turn, 2.0, 0.5}, {2.0, 0.0, 0.0}});
        synthesiser.push(events::BodyMotion{now + 0.049, b, {1.1 + b + 0.1 * turn, 2.0, 0.5}, {2.0, 0.0, 0.0}});
        synthesiser.set_effects(b, sets[static_cast<std::size_t>(turn + b) % sets.size()]);
      }
      play(synthesiser, out, 2400, block);
    }
    return out;
  };
  const auto whole = play_all(2400);
  EXPECT_GT(find_peak(whole[0], 0, whole[0].size()), 0.1);
  for (const int block : {1, 32, 75, 128, 160}) {
    const auto parts = play_all(block);
    for (std::size_t c = 0; c < 2; ++c)
      EXPECT_EQ(std::memcmp(whole[c].data(), parts[c].data(), whole[c].size() * sizeof(float)), 0) << block;
  }
}

TEST(BodyEffects, WithoutTwoEarsAllHearWhatIsHeardInTheMiddle) {
  const auto model = make_model({{700.0, 3.0}});
  const auto play_one = [&](std::vector<Vec3> microphones, EffectSet effects) {
    Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = std::move(microphones)});
    const int body = synthesiser.add_body(model, {.position_m = {1.0, 0.5, 0.0}, .effects = effects});
    synthesiser.push(make_impulse(body, 0.01));
    std::vector<std::vector<float>> out;
    play(synthesiser, out, 9600);
    EXPECT_EQ(synthesiser.get_effect_counters(body).units[Effect::kTwoEars] > 0, effects.has(Effect::kTwoEars) && out.size() > 1);
    return out;
  };
  const auto middle = play_one({{0.2, 0.0, 0.0}}, kDefaultEffects);
  const auto both = play_one({{-0.1, 0.0, 0.0}, {0.5, 0.0, 0.0}}, kDefaultEffects.without(Effect::kTwoEars));
  const auto apart = play_one({{-0.1, 0.0, 0.0}, {0.5, 0.0, 0.0}}, kDefaultEffects);
  EXPECT_EQ(both[0], both[1]);
  EXPECT_NE(apart[0], apart[1]);
  for (std::size_t n = 0; n < middle[0].size(); ++n) ASSERT_NEAR(both[0][n], middle[0][n], 1e-6) << n;
}

TEST(BodyEffects, AreRefusedWhereTheyCannotBe) {
  bank::Bank weightless = testing::make_cube_bank({{500.0, 3.0}});
  weightless.rigid.mass_kg = 0.0;
  Synthesiser synthesiser({.rate_hz = kRate});
  const auto model = Model::make(weightless, {.rate_hz = kRate});
  EXPECT_THROW(synthesiser.add_body(model, {.effects = kHere}), InputError);
  const int body = synthesiser.add_body(model);
  EXPECT_THROW(synthesiser.set_effects(body, kHere), InputError);
  EXPECT_EQ(synthesiser.get_effects(body), kDefaultEffects);
  EXPECT_THROW(synthesiser.set_effects(body + 1, {}), InputError);
  EXPECT_THROW((void)synthesiser.get_effects(-1), InputError);
  EXPECT_THROW(synthesiser.add_body(model, {.rotation = {0.0, 0.0, 0.0, 0.0}}), InputError);
  EXPECT_THROW(synthesiser.add_body(model, {.longest_m = -1.0}), InputError);
  EXPECT_EQ(synthesiser.get_effect_counters(-1).bytes, EffectBytes{});
  EXPECT_EQ(synthesiser.get_effect_counters(1 << 20).units, EffectCounters{}.units);
}

std::int64_t g_ticks = 0;

// The counter of time is a counter of calls here: it sees who is worked for.
TEST(BodyEffects, TicksGoToTheEffectsThatWorkAndSleepingBodiesAreNotLookedAt) {
  Synthesiser synthesiser({.rate_hz = kRate, .max_bodies = 1000, .ticks = []() noexcept { return static_cast<std::uint64_t>(++g_ticks); }});
  const auto model = make_model({{500.0, 400.0}});
  for (int b = 0; b < 1000; ++b) synthesiser.add_body(model, {.position_m = {0.0, 2.0, 0.01 * b}, .effects = kHere, .longest_m = 20.0});
  std::vector<std::vector<float>> out;
  play(synthesiser, out, 1280);
  EXPECT_EQ(g_ticks, 0);
  synthesiser.push(make_impulse(700, 0.03));
  play(synthesiser, out, 2400);
  const EffectCounters counters = synthesiser.get_effect_counters(700);
  for (const Effect effect : {Effect::kModal, Effect::kAccelerationNoise, Effect::kAirDelay, Effect::kTwoEars})
    EXPECT_GT(counters.ticks[effect], 0) << get_name(effect);
  EXPECT_EQ(counters.ticks[Effect::kDoppler], 0);  // nothing moved
  EXPECT_EQ(counters.units[Effect::kDoppler], 0);
  for (const int other : {0, 699, 701}) EXPECT_EQ(synthesiser.get_effect_counters(other).ticks, PerEffect<std::int64_t>{});
  EXPECT_NEAR(synthesiser.get_peak_pa(700), 1.0, 0.2);
  EXPECT_EQ(synthesiser.get_peak_pa(3), 0.0);
  play(synthesiser, out, 48000);  // back to sleep
  const std::int64_t slept = g_ticks;
  play(synthesiser, out, 4800);
  EXPECT_EQ(g_ticks, slept);
  // And it wakes as if it had never slept.
  synthesiser.push(make_impulse(700, synthesiser.get_time_s() + 0.03));
  const std::size_t again = out[0].size();
  play(synthesiser, out, 4800);
  EXPECT_NEAR(find_peak(out[0], again, again + 4800), find_peak(out[0], 0, 4800), 1e-3);
}

/// A contact that slides from 0.05 s on, a record a millisecond; without an end.
std::vector<events::LastingContact> make_slide(int body, double end_s) {
  std::vector<events::LastingContact> records;
  for (int k = 0; k < static_cast<int>(1e3 * (end_s - 0.05)); ++k) {
    records.push_back({.time_s = 0.05 + 1e-3 * k,
                       .id = 5,
                       .body = body,
                       .triangle = 4,
                       .state = k == 0 ? events::ContactState::kBegin : events::ContactState::kHold,
                       .barycentric = {0.2, 0.3, 0.5},
                       .normal = {0.0, 0.0, 1.0},
                       .slip_m_s = {0.4, 0.0, 0.0},
                       .force_n = 5.0,
                       .sweep_m_s = 0.4,
                       .other_sweep_m_s = 0.1,
                       .patch_radius_m = 1e-4,
                       .impedance_n_s_m = 3.0});
  }
  return records;
}

constexpr EffectSet kTouching = kHere.with({Effect::kRoughness, Effect::kRolling, Effect::kContactDamping});

// What is heard of a body that slides is what its voice plays with these forces, 480 samples late and 1 / 3.43 as loud.
TEST(BodyEffects, ContactsThatLastAreHeardAsTheirForcesSay) {
  const auto model = make_model({{420.0, 6.0}, {1370.0, 9.0}, {5200.0, 20.0}});
  Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{0.0, 0.0, 0.0}}});
  std::vector<std::vector<float>> out;
  play(synthesiser, out, 1280);  // so that its voice begins later than the scene
  const ContactSurface surface{.roughness_m = 6e-6, .friction = 0.3};
  const int body = synthesiser.add_body(model, {.position_m = {0.0, 3.43, 0.0}, .effects = kTouching, .surface = surface});
  Voice voice(model);
  ContactForces forces(model, {.surface = surface});
  voice.attach(&forces);
  for (events::LastingContact record : make_slide(body, 0.3)) {
    EXPECT_TRUE(synthesiser.push(record));
    record.time_s -= 1280 / kRate;
    EXPECT_TRUE(forces.take(record, kGroundSurface));
  }
  EXPECT_TRUE(synthesiser.push(events::TimeWatermark{1.0}));
  forces.reach(1.0 - 1280 / kRate);
  play(synthesiser, out, 12000);
  std::vector<float> alone(12000);
  voice.process(alone);
  const double peak = find_peak(alone, 0, 12000);
  EXPECT_GT(peak, 1e-6);
  for (std::size_t n = 1280 + 496; n < out[0].size(); ++n) ASSERT_NEAR(3.43 * out[0][n], alone[n - 1280 - 496], 1e-5 * peak) << n;
  const EffectCounters counters = synthesiser.get_effect_counters(body);
  for (const Effect effect : {Effect::kRoughness, Effect::kRolling, Effect::kContactDamping}) EXPECT_GT(counters.units[effect], 8000);
  EXPECT_EQ(counters.bytes[Effect::kRoughness], static_cast<std::int64_t>(forces.calc_bytes()));
  EXPECT_EQ(counters.bytes[Effect::kRolling], 0);
}

TEST(BodyEffects, ContactsWithAnotherBodyTouchItsSurface) {
  // What is heard depends on the other body's roughness, and continues when the model changes.
  const std::vector<testing::InventedMode> modes{{420.0, 6.0}, {1370.0, 9.0}, {5200.0, 20.0}};
  const auto model = make_model(modes);
  const auto hear = [&](double other_m, bool swaps) {
    Synthesiser synthesiser({.rate_hz = kRate});
    const int body = synthesiser.add_body(model, {.position_m = {0.0, 2.0, 0.0}, .effects = kTouching});
    const int other = synthesiser.add_body(model, {.effects = {}, .surface = {.roughness_m = other_m}});
    std::vector<float> heard(24000), right(24000);
    for (events::LastingContact record : make_slide(body, 0.5)) {
      record.other = other;
      synthesiser.push(record);
    }
    synthesiser.push(events::TimeWatermark{0.5});
    for (int n = 0; n < 24000; n += 480) {
      if (swaps && n == 12000) synthesiser.swap_model(body, make_model(modes));
      const std::array<float*, 2> out{heard.data() + n, right.data() + n};
      synthesiser.process(out.data(), 2, 480);
    }
    double late = 0.0;
    for (int n = 18000; n < 22000; ++n) late += static_cast<double>(heard[n]) * heard[n];
    return std::sqrt(late);
  };
  EXPECT_GT(hear(2e-6, false), 0.0);
  EXPECT_NE(hear(20e-6, false), hear(2e-6, false));
  EXPECT_NEAR(hear(2e-6, true) / hear(2e-6, false), 1.0, 1e-3) << "another model of the same modes";
}

TEST(BodyEffects, ContactsAreNothingToBodiesWithoutTheirEffects) {
  const auto model = make_model({{420.0, 6.0}, {1370.0, 9.0}});
  for (int turn = 0; turn < 3; ++turn) {
    Synthesiser synthesiser({.rate_hz = kRate});
    const int body = synthesiser.add_body(model, {.position_m = {0.0, 1.0, 0.0}, .effects = turn == 0 ? kHere : kTouching});
    std::vector<std::vector<float>> out;
    play(synthesiser, out, 256);
    if (turn == 1) synthesiser.set_effects(body, kHere);
    for (const events::LastingContact& record : make_slide(body, 0.4)) synthesiser.push(record);
    synthesiser.push(events::TimeWatermark{10.0});
    play(synthesiser, out, 12000);
    const EffectCounters counters = synthesiser.get_effect_counters(body);
    const bool touches = turn == 2;
    EXPECT_EQ(counters.units[Effect::kRoughness] > 0, touches);
    EXPECT_EQ(counters.units[Effect::kContactDamping] > 0, touches);
    EXPECT_EQ(find_peak(out[0], 0, out[0].size()) > 0.0, touches);
    synthesiser.collect();
    EXPECT_EQ(synthesiser.get_effect_counters(body).bytes[Effect::kRoughness] > 0, touches);
    if (!touches) continue;
    // It continues, with rolling alone it is silent (this one slides) but still damps, and then it falls and is freed.
    synthesiser.set_effects(body, kHere.with({Effect::kRolling, Effect::kContactDamping}));
    play(synthesiser, out, 2400);
    synthesiser.collect();
    EXPECT_EQ(synthesiser.get_effect_counters(body).bytes[Effect::kRoughness], 0);
    EXPECT_EQ(synthesiser.get_effect_counters(body).bytes[Effect::kRolling], counters.bytes[Effect::kRoughness]);
    synthesiser.set_effects(body, kHere);
    play(synthesiser, out, 1200);
    synthesiser.collect();
    const EffectCounters after = synthesiser.get_effect_counters(body);
    EXPECT_EQ(after.bytes[Effect::kRolling], 0);
    play(synthesiser, out, 1200);
    EXPECT_EQ(synthesiser.get_effect_counters(body).units[Effect::kContactDamping], after.units[Effect::kContactDamping]);
  }
}

}  // namespace
}  // namespace carillon::synth
