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

// One effect is left out at a time. Memory: NoHeap.DisabledEffectsTakeNoMemory.
TEST(BodyEffects, DisabledEffectsDoNoWork) {
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
      }
    }
    if (effects.has(Effect::kHertzPulse)) {
      EXPECT_EQ(counters.units[Effect::kHertzPulse], 1);
    }
    if (effects.has(Effect::kTwoEars) && off < 0) {
      EXPECT_EQ(2 * counters.units[Effect::kTwoEars], counters.units[Effect::kAirDelay]);
    }
  }
}

TEST(BodyEffects, WithoutTwoEarsAllHearTheMiddle) {
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

TEST(BodyEffects, ImpossibleEffectsAreRefused) {
  bank::Bank weightless = testing::make_cube_bank({{500.0, 3.0}});
  weightless.rigid.mass_kg = 0.0;
  Synthesiser synthesiser({.rate_hz = kRate});
  const auto model = Model::make(weightless, {.rate_hz = kRate});
  EXPECT_THROW(synthesiser.add_body(model, {.effects = kHere}), InputError);
  EXPECT_EQ(synthesiser.get_effects(synthesiser.add_body(model)), kDefaultEffects);
  EXPECT_THROW((void)synthesiser.get_effects(-1), InputError);
  EXPECT_THROW(synthesiser.add_body(model, {.rotation = {0.0, 0.0, 0.0, 0.0}}), InputError);
  EXPECT_THROW(synthesiser.add_body(model, {.longest_m = -1.0}), InputError);
  EXPECT_EQ(synthesiser.get_effect_counters(-1).units, EffectCounters{}.units);
  EXPECT_EQ(synthesiser.get_effect_counters(1 << 20).units, EffectCounters{}.units);
}

TEST(BodyEffects, SleepingBodiesDoNoWork) {
  Synthesiser synthesiser({.rate_hz = kRate, .max_bodies = 1000});
  const auto model = make_model({{500.0, 400.0}});
  for (int b = 0; b < 1000; ++b) synthesiser.add_body(model, {.position_m = {0.0, 2.0, 0.01 * b}, .effects = kHere, .longest_m = 20.0});
  std::vector<std::vector<float>> out;
  play(synthesiser, out, 1280);
  EXPECT_EQ(synthesiser.get_effect_counters(700).units, EffectCounters{}.units);
  synthesiser.push(make_impulse(700, 0.03));
  play(synthesiser, out, 2400);
  const EffectCounters counters = synthesiser.get_effect_counters(700);
  for (const Effect effect : {Effect::kModal, Effect::kAccelerationNoise, Effect::kAirDelay, Effect::kTwoEars})
    EXPECT_GT(counters.units[effect], 0) << get_name(effect);
  EXPECT_EQ(counters.units[Effect::kDoppler], 0);  // nothing moved
  for (const int other : {0, 699, 701}) EXPECT_EQ(synthesiser.get_effect_counters(other).units, EffectCounters{}.units);
  EXPECT_NEAR(synthesiser.get_peak_pa(700), 1.0, 0.2);
  EXPECT_EQ(synthesiser.get_peak_pa(3), 0.0);
  play(synthesiser, out, 48000);  // back to sleep
  const EffectCounters slept = synthesiser.get_effect_counters(700);
  play(synthesiser, out, 4800);
  EXPECT_EQ(synthesiser.get_effect_counters(700).units, slept.units);
  // It wakes as if it had never slept.
  synthesiser.push(make_impulse(700, synthesiser.get_time_s() + 0.03));
  const std::size_t again = out[0].size();
  play(synthesiser, out, 4800);
  EXPECT_NEAR(find_peak(out[0], again, again + 4800), find_peak(out[0], 0, 4800), 1e-3);
}

/// Contact sliding from 0.05 s on, a record per millisecond; without an end.
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

// A sliding body sounds as its ResonatorBank with these forces, 480 samples later and 1 / 3.43 as loud.
TEST(BodyEffects, LastingContactsSoundAsTheirForces) {
  const auto model = make_model({{420.0, 6.0}, {1370.0, 9.0}, {5200.0, 20.0}});
  Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{0.0, 0.0, 0.0}}});
  std::vector<std::vector<float>> out;
  play(synthesiser, out, 1280);  // so that its voice begins later than the scene
  const ContactSurface surface{.roughness_m = 6e-6, .friction = 0.3};
  const int body = synthesiser.add_body(model, {.position_m = {0.0, 3.43, 0.0}, .effects = kTouching, .surface = surface});
  ResonatorBank voice(model);
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
}

TEST(BodyEffects, ContactsWithAnotherBodyTouchItsSurface) {
  // The sound depends on the other body's roughness, and continues after a model swap.
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

TEST(BodyEffects, BodiesWithoutContactEffectsIgnoreContacts) {
  const auto model = make_model({{420.0, 6.0}, {1370.0, 9.0}});
  for (const bool touches : {false, true}) {
    Synthesiser synthesiser({.rate_hz = kRate});
    const int body = synthesiser.add_body(model, {.position_m = {0.0, 1.0, 0.0}, .effects = touches ? kTouching : kHere});
    std::vector<std::vector<float>> out;
    for (const events::LastingContact& record : make_slide(body, 0.4)) synthesiser.push(record);
    synthesiser.push(events::TimeWatermark{10.0});
    play(synthesiser, out, 12000);
    const EffectCounters counters = synthesiser.get_effect_counters(body);
    EXPECT_EQ(counters.units[Effect::kRoughness] > 0, touches);
    EXPECT_EQ(counters.units[Effect::kContactDamping] > 0, touches);
    EXPECT_EQ(find_peak(out[0], 0, out[0].size()) > 0.0, touches);
    EXPECT_EQ(synthesiser.get_counters().contacts.without_use > 0, !touches);
  }
}

}  // namespace
}  // namespace carillon::synth
