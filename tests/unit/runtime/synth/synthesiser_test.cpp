#include "runtime/synth/synthesiser.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstring>
#include <functional>
#include <limits>
#include <random>
#include <thread>
#include <vector>

#include "runtime/base/error.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::synth {
namespace {

constexpr double kRate = 48000.0;

std::shared_ptr<const Model> make_model(int modes, double decay_per_s = 20.0) {
  std::vector<testing::InventedMode> invented;
  for (int m = 0; m < modes; ++m) invented.push_back({200.0 + 173.0 * m, decay_per_s * (1.0 + 0.1 * m), 1.0, {0.3, 0.2, 1.0}, 0.1});
  return Model::make(testing::make_cube_bank(invented), {.rate_hz = kRate});
}

using Channels = std::vector<std::vector<float>>;

/// Plays `frames` frames in blocks of next_block(); before each block pushes the `events` that begin up to half a second after it.
template <typename NextBlock>
Channels play(Synthesiser& synthesiser, const std::vector<events::Event>& events, int frames, NextBlock&& next_block) {
  const int channels = synthesiser.get_microphone_count();
  Channels out(static_cast<std::size_t>(channels), std::vector<float>(frames, 99.0F));
  std::size_t next = 0;
  for (int done = 0; done < frames;) {
    const int block = std::min(next_block(), frames - done);
    while (next < events.size() && events::get_time_s(events[next]) < (done + block) / kRate + 0.5) {
      EXPECT_TRUE(synthesiser.push(events[next]));
      ++next;
    }
    std::vector<float*> at;
    for (auto& channel : out) at.push_back(channel.data() + done);
    synthesiser.process(at.data(), channels, block);
    done += block;
  }
  return out;
}

events::Impulse make_impulse(int body, double time_s, double impulse_n_s = 1e-3) {
  return {.time_s = time_s,
          .body = body,
          .triangle = 4,
          .barycentric = {0.2, 0.3, 0.5},
          .impulse_n_s = {0.0, 0.0, impulse_n_s},
          .duration_s = 2e-4};
}

/// Many strikes on passing bodies.
std::vector<events::Event> make_hail(int bodies, double seconds) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::vector<events::Event> events;
  for (int b = 0; b < bodies; ++b) {
    for (double t = 0.0; t < seconds; t += 0.01)
      events.emplace_back(events::BodyMotion{t, b, {3.0 * std::cos(t + b), 2.0 + 0.1 * b, 1.0}, {-3.0 * std::sin(t + b), 0.0, 0.0}});
    for (double t = 0.02 * unit(random); t < seconds; t += 0.05 * unit(random)) {
      events::Impulse impulse = make_impulse(b, t, 1e-3 * unit(random));
      impulse.shape = unit(random) < 0.3 ? events::PulseShape::kGaussian : events::PulseShape::kHertz;
      impulse.duration_s = unit(random) < 0.2 ? 0.0 : 5e-4 * unit(random);
      events.emplace_back(impulse);
    }
  }
  for (double t = 0.0; t < seconds; t += 0.02)
    events.emplace_back(events::Listener{.time_s = t, .position_m = {0.0, -t, 0.0}, .velocity_m_s = {0.0, -1.0, 0.0}});
  std::stable_sort(events.begin(), events.end(),
                   [](const auto& a, const auto& b) { return events::get_time_s(a) < events::get_time_s(b); });
  return events;
}

Channels play_hail(int bodies, double seconds, const std::function<int()>& next_block) {
  Synthesiser synthesiser({.rate_hz = kRate, .max_waypoints = 256});
  for (int b = 0; b < bodies; ++b) synthesiser.add_body(make_model(20 + b), {.position_m = {3.0, 2.0, 1.0}});
  return play(synthesiser, make_hail(bodies, seconds), static_cast<int>(seconds * kRate), next_block);
}

TEST(Synthesiser, GivesTheSameBitsInBlocksOfAnySize) {
  constexpr double kSeconds = 1.0;
  const Channels whole = play_hail(5, kSeconds, [] { return 4096; });
  EXPECT_GT(*std::max_element(whole[0].begin(), whole[0].end()), 1e-4F);
  std::mt19937 random(5);
  std::uniform_int_distribution<int> any(1, 700);
  for (const std::function<int()>& next : {std::function<int()>([] { return 1; }),
                                           {[] { return 7; }},
                                           {[] { return 31; }},
                                           {[] { return 32; }},
                                           {[] { return 33; }},
                                           {[] { return 64; }},
                                           {[] { return 127; }},
                                           {[&] { return any(random); }}}) {
    const Channels parts = play_hail(5, kSeconds, next);
    for (std::size_t c = 0; c < whole.size(); ++c)
      EXPECT_EQ(std::memcmp(whole[c].data(), parts[c].data(), whole[c].size() * sizeof(float)), 0);
  }
}

// A body 343 m * k / 48000 away is heard k samples later, 1 / r as loud: its ResonatorBank alone, up to single precision and the ripple of
// the sinc.
TEST(Synthesiser, IsItsResonatorBanksWithPropagation) {
  const auto model = make_model(30);
  constexpr int kDelay = 280;
  const double distance = kDelay * kSoundSpeedMs / kRate;
  Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{0.0, 0.0, 0.0}}});
  const int body = synthesiser.add_body(model, {.position_m = {0.0, distance, 0.0}});
  const events::Impulse impulse = make_impulse(body, 0.003);
  const Channels out = play(synthesiser, {impulse}, 20000, [] { return 480; });
  ResonatorBank voice(model);
  EXPECT_TRUE(voice.strike(impulse));
  std::vector<float> alone(20000, 0.0F);
  voice.process(alone);
  const float peak = *std::max_element(alone.begin(), alone.end());
  constexpr int kAll = kDelay + Synthesiser::kLatency;
  for (int n = 0; n < kAll; ++n) EXPECT_NEAR(out[0][n], 0.0, 1e-6 * peak);
  for (int n = kAll; n < 20000; ++n) ASSERT_NEAR(distance * out[0][n], alone[n - kAll], 2e-6 * peak) << n;
}

TEST(Synthesiser, ABodyThatIsCutJumpsWithoutAChirp) {
  constexpr double kJump = 0.1;
  const Vec3 near{0.0, 1.0, 0.0}, far{0.0, 4.0, 0.0};
  const auto ring = [&](const Vec3& from, const Vec3& to, bool is_cut) {
    Synthesiser synthesiser({.rate_hz = kRate});
    const int body = synthesiser.add_body(make_model(1, 2.0), {.position_m = from});
    std::vector<events::Event> events{make_impulse(body, 0.01)};
    if (from != to) events.emplace_back(events::BodyMotion{.time_s = kJump, .body = body, .position_m = to, .cut = is_cut});
    return play(synthesiser, events, 9600, [] { return 100; })[0];
  };
  for (const bool leaves : {true, false}) {
    const Vec3 &from = leaves ? near : far, &to = leaves ? far : near;
    const auto jump = ring(from, to, true), before = ring(from, from, false), after = ring(to, to, false);
    const auto path = ring(from, to, false);
    const int begin = static_cast<int>((kJump + 1.0 / 343.0) * kRate) - 64, end = static_cast<int>((kJump + 4.0 / 343.0) * kRate) + 128;
    double largest = 0.0, least = 0.0;
    for (int n = 0; n < begin; ++n) largest = std::max(largest, static_cast<double>(std::abs(before[n])));
    for (int n = 0; n < begin; ++n) ASSERT_NEAR(jump[n], before[n], 1e-4 * largest) << n;
    for (int n = end; n < 9600; ++n) ASSERT_NEAR(jump[n], after[n], 1e-4 * largest) << n;
    double step = 0.0, chirp = 0.0;
    for (int n = begin; n < end; ++n) {
      step = std::max(step, static_cast<double>(std::abs(jump[n] - jump[n - 1])));
      least = std::max(
          {least, static_cast<double>(std::abs(before[n] - before[n - 1])), static_cast<double>(std::abs(after[n] - after[n - 1]))});
      chirp = std::max(chirp, static_cast<double>(std::abs(path[n] - before[n])));
    }
    EXPECT_LT(step, 3.0 * least) << "no click";
    EXPECT_GT(chirp, 0.1 * largest) << "a path in between is heard";
  }
}

TEST(Synthesiser, AddsBodiesUpAndKeepsTimeForThoseThatComeLater) {
  const auto model = make_model(12);
  const auto play_one = [&](double time_s, int before) {
    Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{0.0, 0.0, 0.0}}});
    std::vector<float> lead(before + 1);
    float* at = lead.data();
    if (before > 0) synthesiser.process(&at, 1, before);
    const int body = synthesiser.add_body(model, {.position_m = {0.0, 1.0, 0.0}});
    EXPECT_TRUE(synthesiser.push(make_impulse(body, time_s)));
    std::vector<float> out(9600);
    at = out.data();
    synthesiser.process(&at, 1, 9600);
    return out;
  };
  const std::vector<float> now = play_one(0.02, 0);
  const std::vector<float> later = play_one(0.02 + 1280 * 7 / kRate, 1280 * 7);
  const float peak = *std::max_element(now.begin(), now.end());
  EXPECT_GT(peak, 1e-6F);
  for (std::size_t n = 0; n < now.size(); ++n) ASSERT_NEAR(now[n], later[n], 1e-6 * peak) << n;
}

TEST(Synthesiser, RemovedBodiesFallSilentAndTheirNumbersComeBack) {
  Synthesiser synthesiser({.rate_hz = kRate, .max_bodies = 2});
  const auto model = make_model(8, 0.5);
  const int first = synthesiser.add_body(model, {.position_m = {0.0, 1.0, 0.0}});
  EXPECT_EQ(synthesiser.add_body(model), 1);
  EXPECT_TRUE(synthesiser.is_full());
  EXPECT_THROW(synthesiser.add_body(model), InputError);
  Channels out = play(synthesiser, {make_impulse(first, 0.001)}, 4800, [] { return 100; });
  EXPECT_GT(std::abs(out[0].back()) + std::abs(out[0][4700]), 0.0F);
  synthesiser.remove_body(first);
  EXPECT_THROW(synthesiser.remove_body(first), InputError);
  out = play(synthesiser, {}, 4800, [] { return 100; });
  for (std::size_t n = 128; n < out[0].size(); ++n) ASSERT_EQ(out[0][n], 0.0F);
  EXPECT_FALSE(synthesiser.is_full());
  EXPECT_EQ(synthesiser.add_body(model), first);
  EXPECT_THROW(synthesiser.remove_body(7), InputError);
}

TEST(Synthesiser, CountsUnplayableEvents) {
  Synthesiser synthesiser({.rate_hz = kRate, .ring_events = 4});
  const int body = synthesiser.add_body(make_model(4));
  EXPECT_TRUE(synthesiser.push(make_impulse(9, 0.0)));  // of no body
  events::Impulse outside = make_impulse(body, 0.0);
  outside.triangle = 1000;
  EXPECT_TRUE(synthesiser.push(outside));
  EXPECT_FALSE(synthesiser.push(events::TimeWatermark{std::numeric_limits<double>::infinity()}));
  EXPECT_TRUE(synthesiser.push(make_impulse(body, 0.01)));
  EXPECT_TRUE(synthesiser.push(make_impulse(body, 0.01)));
  EXPECT_FALSE(synthesiser.push(make_impulse(body, 0.01)));
  play(synthesiser, {}, 4800, [] { return 64; });
  EXPECT_TRUE(synthesiser.push(make_impulse(body, 0.02)));  // 0.08 s too late
  play(synthesiser, {}, 192, [] { return 64; });
  // The rest of that pulse, as late as its beginning.
  EXPECT_TRUE(synthesiser.push(
      events::Force{.time_s = 0.02, .step_s = 1e-5, .body = body, .count = 1, .continues = true, .impulse_n_s = {{{0, 0, 1e-3F}}}}));
  play(synthesiser, {}, 64, [] { return 64; });
  const SynthesiserCounters counters = synthesiser.get_counters();
  EXPECT_EQ(counters.strikes, 3);
  EXPECT_EQ(counters.refused, 2);
  EXPECT_EQ(counters.late, 1);
  EXPECT_EQ(counters.faults, 1);
  EXPECT_EQ(counters.overflows, 1);
  EXPECT_DOUBLE_EQ(synthesiser.get_time_s(), 5056 / kRate);
  EXPECT_GE(synthesiser.get_horizon_s(), synthesiser.get_time_s());
}

TEST(Synthesiser, SleepingBodiesDoNoWork) {
  Synthesiser synthesiser({.rate_hz = kRate});
  const int body = synthesiser.add_body(make_model(16, 400.0), {.position_m = {0.0, 1.0, 0.0}});
  play(synthesiser, {make_impulse(body, 0.001)}, 48000, [] { return 256; });
  const std::int64_t before = synthesiser.get_counters().mode_samples;
  EXPECT_GT(before, 0);
  play(synthesiser, {}, 48000, [] { return 256; });
  EXPECT_EQ(synthesiser.get_counters().mode_samples, before);
}

// No mode-sample is counted for decayed bodies.
TEST(Synthesiser, ADecayedBodyCostsNothing) {
  Synthesiser synthesiser({.rate_hz = kRate, .max_bodies = 40});
  const auto model = make_model(100, 60.0);
  std::vector<events::Event> events;
  for (int b = 0; b < 40; ++b) {
    synthesiser.add_body(model, {.position_m = {0.0, 1.0, 0.0}});
    if (b % 2 == 0) events.emplace_back(make_impulse(b, 0.001 + 0.0001 * b));
  }
  play(synthesiser, events, 48000, [] { return 256; });
  EXPECT_GT(synthesiser.get_counters().mode_samples, 20 * 100 * 128);
  // The modes die one after the other, and are left out one after the other: far less than all of them until the last is silent.
  EXPECT_LT(synthesiser.get_counters().mode_samples, 20LL * 112 * 48000 / 2);
  const auto units = [&](int body) { return synthesiser.get_effect_counters(body).units; };
  std::vector<PerEffect<std::int64_t>> before;
  for (int b = 0; b < 40; ++b) before.push_back(units(b));
  EXPECT_EQ(units(1)[Effect::kModal], 0);  // never struck
  const std::int64_t work = synthesiser.get_counters().mode_samples;
  const Channels out = play(synthesiser, {}, 48000, [] { return 256; });
  EXPECT_EQ(synthesiser.get_counters().mode_samples, work);
  for (int b = 0; b < 40; ++b)
    for (int e = 0; e < kEffectCount; ++e) EXPECT_EQ(units(b)[static_cast<Effect>(e)], before[b][static_cast<Effect>(e)]);
  EXPECT_EQ(*std::max_element(out[0].begin(), out[0].end()), 0.0F);
}

// Physics stops during a contact: the sound continues for 20 ms, then fades out within 5 ms except for ringing modes; again when physics
// continues.
TEST(Synthesiser, AContactWithoutFurtherRecordsFallsSilent) {
  const auto model = Model::make(testing::make_cube_bank({{800.0, 500.0, 1.0, {0.0, 0.0, 1.0}}, {3100.0, 500.0, 1.0, {0.0, 0.0, 1.0}}}),
                                 {.rate_hz = kRate});
  Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{0.0, 0.0, 0.0}}});
  const int body = synthesiser.add_body(model, {.position_m = {0.0, 0.05, 0.0}, .effects = EffectSet{Effect::kModal, Effect::kRoughness}});
  std::vector<events::Event> events;
  for (int i = 0; i <= 20; ++i) {
    events.emplace_back(events::LastingContact{.time_s = 0.01 * i,
                                               .id = 1,
                                               .body = body,
                                               .normal = {0.0, 0.0, 1.0},
                                               .slip_m_s = {0.5, 0.0, 0.0},
                                               .force_n = 5.0,
                                               .other_sweep_m_s = 0.5,
                                               .patch_radius_m = 2e-4});
    events.emplace_back(events::TimeWatermark{0.01 * i});
  }
  const Channels out = play(synthesiser, events, 28800, [] { return 64; });
  const auto find_peak = [&](double from_s, double to_s) {
    float peak = 0.0F;
    for (auto n = static_cast<std::size_t>(from_s * kRate); n < static_cast<std::size_t>(to_s * kRate); ++n)
      peak = std::max(peak, std::abs(out[0][n]));
    return peak;
  };
  const float sliding = find_peak(0.1, 0.2);
  EXPECT_GT(sliding, 0.0F);
  EXPECT_GT(find_peak(0.2, 0.215), 0.1F * sliding);   // held
  EXPECT_LT(find_peak(0.26, 0.6), 0.001F * sliding);  // e^-(500 x 0.03) after the last force
  EXPECT_EQ(find_peak(0.4, 0.6), 0.0F);
  EXPECT_EQ(synthesiser.get_counters().underruns, 1);
}

TEST(Synthesiser, CountsHowOftenItOvertakesPhysics) {
  Synthesiser synthesiser({.rate_hz = kRate});
  play(synthesiser, {}, 4800, [] { return 64; });
  EXPECT_EQ(synthesiser.get_counters().underruns, 0);  // it was not said how far physics has run
  EXPECT_TRUE(synthesiser.push(events::TimeWatermark{0.2}));
  play(synthesiser, {}, 4800 - 256, [] { return 64; });
  EXPECT_EQ(synthesiser.get_counters().underruns, 0);
  play(synthesiser, {}, 4800, [] { return 64; });
  EXPECT_EQ(synthesiser.get_counters().underruns, 1);         // once, however long it lasts
  EXPECT_TRUE(synthesiser.push(events::TimeWatermark{0.1}));  // an older one changes nothing
  EXPECT_TRUE(synthesiser.push(events::TimeWatermark{0.4}));
  play(synthesiser, {}, 4800 - 256, [] { return 64; });
  EXPECT_EQ(synthesiser.get_counters().underruns, 1);
  play(synthesiser, {}, 9600, [] { return 64; });
  EXPECT_EQ(synthesiser.get_counters().underruns, 2);
}

// By the modes, acceleration noise, propagation and the gain.
TEST(Synthesiser, NonFiniteNumbersNeverReachTheOutput) {
  std::vector<testing::InventedMode> modes{{300.0, 20.0, 1.0, {0.3, 0.2, 1.0}}, {20000.0, 1e6, 1.0, {0.3, 0.2, 1.0}}};
  const auto model = Model::make(testing::make_cube_bank(modes), {.rate_hz = kRate, .sphere_radius_m = 0.05});
  for (const EffectSet effects : {EffectSet{Effect::kModal}, EffectSet{Effect::kAccelerationNoise},
                                  EffectSet{Effect::kModal, Effect::kAccelerationNoise, Effect::kAirDelay, Effect::kTwoEars}}) {
    Synthesiser synthesiser({.rate_hz = kRate});
    const int wild = synthesiser.add_body(model, {.position_m = {0.0, 1.0, 0.0}, .effects = effects});
    const int tame = synthesiser.add_body(model, {.position_m = {0.0, 1.0, 1.0}, .effects = effects});
    const auto play_all = [&](std::vector<events::Event> events) {
      const Channels out = play(synthesiser, events, 4800, [] { return 64; });
      for (const auto& channel : out)
        for (const float p : channel) EXPECT_TRUE(std::isfinite(p));
      return *std::max_element(out[0].begin(), out[0].end());
    };
    events::Impulse huge = make_impulse(wild, 0.02);
    huge.impulse_n_s = {1e308, 1e308, -1e308};
    play_all({make_impulse(wild, 0.01), huge});
    const SynthesiserCounters counters = synthesiser.get_counters();
    EXPECT_GE(counters.resets, 1);
    EXPECT_EQ(counters.zeroed, 0);  // stopped at its source, before it could drown the other body
    EXPECT_GT(play_all({make_impulse(tame, 0.11)}), 0.0F);
    huge.time_s = 0.25;
    play_all({events::BodyMotion{0.2, wild, {1e300, -1e300, 1e300}, {1e300, 0.0, 0.0}},
              events::BodyMotion{0.21, wild, {-1e300, 1e300, 1e300}, {}}, make_impulse(wild, 0.22), huge});
    play_all({events::Listener{.time_s = 0.31, .position_m = {-1e300, 1e308, 0.0}}, make_impulse(tame, 0.32)});
    synthesiser.set_gain(std::nan(""));
    EXPECT_EQ(play_all({}), 0.0F);
  }
  Synthesiser synthesiser({.rate_hz = kRate});
  const int body = synthesiser.add_body(model, {.position_m = {0.0, 1.0, 0.0}});
  synthesiser.set_gain(3e38);
  const Channels out = play(synthesiser, {make_impulse(body, 0.01, 1e4)}, 4800, [] { return 64; });
  for (const float p : out[0]) EXPECT_TRUE(std::isfinite(p));
  EXPECT_GT(synthesiser.get_counters().zeroed, 0);
}

TEST(Synthesiser, FurtherChannelsAreSilentAndFewerAreEnough) {
  Synthesiser synthesiser({.rate_hz = kRate});
  const int body = synthesiser.add_body(make_model(4), {.position_m = {1.0, 1.0, 0.0}});
  synthesiser.set_gain(2.0);
  EXPECT_TRUE(synthesiser.push(make_impulse(body, 0.001)));
  std::vector<std::vector<float>> out(3, std::vector<float>(2400, 5.0F));
  std::vector<float*> at{out[0].data(), out[1].data(), out[2].data()};
  synthesiser.process(at.data(), 3, 2400);
  EXPECT_GT(*std::max_element(out[1].begin(), out[1].end()), 0.0F);
  EXPECT_EQ(*std::max_element(out[2].begin(), out[2].end()), 0.0F);
  synthesiser.process(at.data(), 1, 100);
  synthesiser.process(at.data(), 0, 100);
  EXPECT_DOUBLE_EQ(synthesiser.get_time_s(), 2600 / kRate);
}

TEST(Synthesiser, RefusesImpossibleOptions) {
  EXPECT_THROW(Synthesiser({.rate_hz = 0.0}), InputError);
  EXPECT_THROW(Synthesiser({.microphones_m = {}}), InputError);
  EXPECT_THROW(Synthesiser({.microphones_m = {{0.0, std::nan(""), 0.0}}}), InputError);
  EXPECT_THROW(Synthesiser({.max_bodies = 0}), InputError);
  EXPECT_THROW(Synthesiser({.longest_m = -1.0}), InputError);
  Synthesiser synthesiser({.rate_hz = 44100.0});
  EXPECT_THROW(synthesiser.add_body(nullptr), InputError);
  EXPECT_THROW(synthesiser.add_body(make_model(3)), InputError);  // for 48 kHz
}

// Other threads push, and bodies and models change during playback (for a data race detector).
TEST(Synthesiser, TakesEventsFromManyThreadsWhileItPlays) {
  Synthesiser synthesiser({.rate_hz = kRate, .max_bodies = 8});
  const auto model = make_model(16), edited = make_model(17);
  std::atomic<bool> stops{false};
  std::vector<std::thread> pushers;
  for (int p = 0; p < 3; ++p) {
    pushers.emplace_back([&, p] {
      for (int i = 0; !stops; ++i) {
        synthesiser.push(make_impulse((p + i) % 8, synthesiser.get_horizon_s() + 1e-3));
        synthesiser.push(events::BodyMotion{synthesiser.get_horizon_s(), i % 8, {1.0, 2.0, 0.01 * (i % 100)}, {}});
        (void)synthesiser.get_counters();
        std::this_thread::yield();
      }
    });
  }
  std::thread audio([&] {
    std::vector<float> left(64), right(64);
    std::array<float*, 2> out{left.data(), right.data()};
    // Until enough was heard of all the others.
    for (int block = 0; block < 1000000 && (block < 2000 || synthesiser.get_counters().strikes < 300); ++block) {
      synthesiser.process(out.data(), 2, 64);
      for (const float x : left) ASSERT_TRUE(std::isfinite(x));
      std::this_thread::yield();
    }
    stops = true;
  });
  std::vector<int> bodies;
  const std::array<EffectSet, 4> kSets{EffectSet{}, {Effect::kModal}, kDefaultEffects.with(Effect::kAccelerationNoise), kDefaultEffects};
  std::size_t turn = 0;
  while (!stops) {
    if (!synthesiser.is_full())
      bodies.push_back(synthesiser.add_body(model, {.position_m = {1.0, 2.0, 0.0}, .effects = kSets[++turn % kSets.size()]}));
    (void)synthesiser.get_effect_counters(bodies.front());
    if (!bodies.empty()) {
      synthesiser.swap_model(bodies.back(), bodies.size() % 2 == 0 ? model : edited);
      synthesiser.set_budget(bodies.size() % 3 == 0 ? 3.0 * kGroup * kRate : 1e12);
    }
    if (bodies.size() > 4) {
      synthesiser.remove_body(bodies.front());
      bodies.erase(bodies.begin());
    }
    std::this_thread::yield();
  }
  audio.join();
  for (std::thread& pusher : pushers) pusher.join();
  EXPECT_GE(synthesiser.get_counters().strikes, 300);
}

// Sensors come and are read by another thread, and bodies go, during playback (for a data race detector). The sensor of a removed body is
// not read any more: another may take its number.
TEST(Synthesiser, SensorsAreAddedAndReadDuringPlayback) {
  const bank::Bank bank = testing::make_cube_bank({{400.0, 30.0}, {900.0, 60.0}});
  const auto model = Model::make(bank, {.rate_hz = kRate});
  Synthesiser synthesiser(SynthesiserOptions{.rate_hz = kRate});
  std::atomic<bool> stops{false};
  std::array<std::atomic<int>, 40> kept{};  // numbers of the sensors whose bodies stay
  std::atomic<int> kept_count{0};
  std::atomic<std::size_t> read{0};
  std::thread audio([&] {
    std::vector<float> left(64), right(64);
    const std::array<float*, 2> out{left.data(), right.data()};
    // Until the other threads have had their turns, however they are scheduled.
    while (kept_count < static_cast<int>(kept.size()) || read <= 1000) {
      synthesiser.process(out.data(), 2, 64);
      std::this_thread::yield();
    }
    stops = true;
  });
  std::thread reader([&] {
    std::vector<double> samples(4096);
    while (!stops) {
      for (int i = 0; i < kept_count; ++i) read += synthesiser.find_sensor(kept[i])->read(samples);
      std::this_thread::yield();
    }
  });
  for (int added = 0; !stops; synthesiser.collect(), std::this_thread::yield()) {
    if (kept_count == static_cast<int>(kept.size()) || synthesiser.is_full()) continue;
    const int body = synthesiser.add_body(model);
    const int sensor = synthesiser.add_sensor(body, bank, {.triangle = 3, .rate_hz = added % 2 == 0 ? 0.0 : 4000.0});
    synthesiser.push(events::Impulse{.time_s = synthesiser.get_horizon_s(), .body = body, .impulse_n_s = {0.0, 0.0, 1.0}});
    if (++added % 3 == 0) {
      synthesiser.remove_body(body);
    } else {
      kept[kept_count] = sensor;
      ++kept_count;
    }
  }
  audio.join();
  reader.join();
  EXPECT_EQ(kept_count, static_cast<int>(kept.size()));
  EXPECT_GT(read, 1000U);
}

}  // namespace
}  // namespace carillon::synth
