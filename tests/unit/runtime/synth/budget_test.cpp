// Budget: removes the least audible modes of all bodies, without a click, and bounds the work.
#include "runtime/synth/budget.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <cstring>
#include <limits>
#include <map>
#include <numbers>
#include <numeric>
#include <random>
#include <vector>

#include "runtime/synth/synthesiser.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::synth {
namespace {

using std::numbers::pi;
constexpr double kRate = 48000.0;
constexpr double kUnlimited = std::numeric_limits<double>::infinity();

/// Bank with modes from `lowest_hz` to `highest_hz`, amplitude of mode m ~ 10^(-m * slope).
bank::Bank make_bank(int modes, double lowest_hz, double highest_hz, double decay_per_s, double slope) {
  std::vector<testing::InventedMode> invented;
  for (int m = 0; m < modes; ++m)
    invented.push_back({lowest_hz + (highest_hz - lowest_hz) * (m + 0.5) / modes, decay_per_s, std::pow(10.0, -m * slope), {0, 0, 1}});
  return testing::make_cube_bank(invented);
}

TEST(Budget, KeepsTheMostAudibleGroupsOfAll) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> exponent(-9.0, 2.0);
  std::vector<std::vector<float>> bodies(40);
  std::vector<float> beyond_first;
  std::int64_t groups = 0;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    for (std::size_t g = 0; g < 1 + b % 13; ++g) bodies[b].push_back(static_cast<float>(std::pow(10.0, exponent(random))));
    std::sort(bodies[b].rbegin(), bodies[b].rend());
    beyond_first.insert(beyond_first.end(), bodies[b].begin() + 1, bodies[b].end());
    groups += static_cast<std::int64_t>(bodies[b].size());
  }
  std::sort(beyond_first.rbegin(), beyond_first.rend());
  for (const int room : {40, 41, 90, 150, static_cast<int>(groups) - 1}) {
    Budget budget;
    ASSERT_TRUE(budget.begin((room + 0.5) * kGroup * kBlock, 0.0, groups, static_cast<int>(bodies.size())));
    for (const auto& body : bodies) budget.add(body);
    budget.decide();
    std::int64_t stay = 0;
    float faintest = std::numeric_limits<float>::max(), loudest = 0.0F;
    for (const auto& body : bodies) {
      const std::size_t limit = budget.find_limit(body);
      ASSERT_GE(limit, 1U);
      stay += static_cast<std::int64_t>(limit);
      if (limit > 1) faintest = std::min(faintest, body[limit - 1]);
      if (limit < body.size()) loudest = std::max(loudest, body[limit]);
    }
    EXPECT_EQ(stay, room);                                    // the room is used up
    EXPECT_LT(loudest, faintest * std::pow(2.0F, 1 / 8.0F));  // in order, to a step of the histogram
    if (room > 40) {
      EXPECT_NEAR(std::log2(faintest / beyond_first[room - 41]), 0.0, 1 / 8.0);
    }
  }
  Budget enough;
  EXPECT_FALSE(enough.begin(static_cast<double>(groups) * kGroup * kBlock, 0.0, groups, 40));
  EXPECT_EQ(enough.get_floor_pa(), 0.0F);
}

struct Played {
  std::vector<float> sound;
  std::vector<std::int64_t> work;  // mode-samples so far, every 10 ms
  SynthesiserCounters counters;
};

/// Bodies of 100 modes at various distances, each struck `strikes_per_s` times a second.
Played play_hail(double budget, double strikes_per_s, double seconds, const std::vector<int>& blocks = {480}) {
  constexpr int kBodies = 24;
  Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{0, 0, 0}}, .max_strikes = 1024, .ring_events = 1 << 14, .budget = budget});
  const auto model = Model::make(make_bank(100, 150.0, 18000.0, 12.0, 0.02), {.rate_hz = kRate});
  for (int b = 0; b < kBodies; ++b) synthesiser.add_body(model, {.position_m = {0.0, 1.0 + 0.4 * b, 0.0}});
  std::mt19937 random(11);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  std::exponential_distribution<double> gap(strikes_per_s * kBodies);
  for (double t = 0.001; t < seconds; t += gap(random)) {
    EXPECT_TRUE(synthesiser.push(events::Impulse{.time_s = t,
                                                 .body = static_cast<int>(kBodies * unit(random)),
                                                 .triangle = 4,
                                                 .barycentric = {0.2, 0.3, 0.5},
                                                 .impulse_n_s = {0.0, 0.0, 1e-3 * std::pow(10.0, -2.0 * unit(random))},
                                                 .duration_s = 1e-4 + 3e-4 * unit(random)}));
  }
  Played played;
  const auto frames = static_cast<int>(seconds * kRate);
  played.sound.resize(frames);
  for (int done = 0, i = 0; done < frames; ++i) {
    const int count = std::min(blocks[static_cast<std::size_t>(i) % blocks.size()], frames - done);
    float* at = played.sound.data() + done;
    synthesiser.process(&at, 1, count);
    done += count;
    if (blocks.size() == 1) played.work.push_back(synthesiser.get_counters().mode_samples);
  }
  played.counters = synthesiser.get_counters();
  return played;
}

double calc_energy(const std::vector<float>& a, const std::vector<float>& b) {
  double sum = 0.0;
  for (std::size_t n = 0; n < a.size(); ++n) sum += (a[n] - b[n]) * (a[n] - b[n]);
  return sum;
}

TEST(Budget, IsKeptUnderAHail) {
  for (const double strikes_per_s : {2.0, 20.0, 100.0, 500.0}) {
    const Played all = play_hail(kUnlimited, strikes_per_s, 1.0);
    EXPECT_EQ(all.counters.faded, 0);
    for (const double share : {0.5, 0.25}) {
      const double budget = share * static_cast<double>(all.counters.mode_samples);
      const Played kept = play_hail(budget, strikes_per_s, 1.0);
      EXPECT_EQ(kept.counters.strikes, all.counters.strikes);  // no hit is dropped
      EXPECT_GT(kept.counters.faded, 0);
      for (std::size_t i = 20; i < kept.work.size(); i += 10)  // any 100 ms once it has begun
        EXPECT_LT(static_cast<double>(kept.work[i] - kept.work[i - 10]), 0.1 * 1.1 * budget)
            << strikes_per_s << " strikes a second, share " << share << ", until " << 0.01 * static_cast<double>(i) << " s";
      EXPECT_LT(static_cast<double>(kept.counters.mode_samples), 1.02 * budget) << strikes_per_s << " " << share;
      EXPECT_GT(static_cast<double>(kept.counters.mode_samples), 0.7 * budget) << strikes_per_s << " " << share;  // and it is used
    }
  }
}

// Lasting contacts drive all modes continuously, at several times the cost of ringing.
TEST(Budget, IsKeptWhileBodiesSlide) {
  constexpr int kBodies = 12;
  const auto model = Model::make(make_bank(100, 150.0, 18000.0, 12.0, 0.02), {.rate_hz = kRate});
  const auto play = [&](double budget) {
    Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{0, 0, 0}}, .budget = budget});
    Played played;
    for (int b = 0; b < kBodies; ++b) {
      const int body = synthesiser.add_body(
          model, {.position_m = {0.0, 1.0 + 0.4 * b, 0.0},
                  .effects = EffectSet{Effect::kModal, Effect::kRoughness, Effect::kRolling, Effect::kContactDamping}});
      for (int i = 0; i <= 50; ++i) {
        EXPECT_TRUE(synthesiser.push(events::LastingContact{.time_s = 0.01 + 0.02 * i,
                                                            .id = 7,
                                                            .body = body,
                                                            .state = i == 0 ? events::ContactState::kBegin : events::ContactState::kHold,
                                                            .normal = {0, 0, 1},
                                                            .slip_m_s = {0.5, 0, 0},
                                                            .force_n = 1.0 + b,
                                                            .sweep_m_s = 0.5,
                                                            .other_sweep_m_s = 0.3,
                                                            .patch_radius_m = 2e-4,
                                                            .impedance_n_s_m = 1.0}));
      }
    }
    EXPECT_TRUE(synthesiser.push(events::TimeWatermark{5.0}));
    played.sound.resize(48000);
    for (int done = 0; done < 48000; done += 480) {
      float* at = played.sound.data() + done;
      synthesiser.process(&at, 1, 480);
      played.work.push_back(synthesiser.get_counters().mode_samples);
    }
    played.counters = synthesiser.get_counters();
    return played;
  };
  const Played all = play(kUnlimited);
  const double work = static_cast<double>(all.counters.mode_samples);
  EXPECT_GT(work, 1.9 * kBodies * 96 * 46000);  // driven: more than ringing alone
  for (const double share : {0.6, 0.4}) {
    const Played kept = play(share * work);
    for (std::size_t i = 30; i < kept.work.size(); i += 10)
      EXPECT_LT(static_cast<double>(kept.work[i] - kept.work[i - 10]), 0.1 * 1.1 * share * work)
          << share << " until " << 0.01 * static_cast<double>(i) << " s";
    EXPECT_LT(static_cast<double>(kept.counters.mode_samples), 1.05 * share * work) << share;
    EXPECT_GT(calc_energy(kept.sound, std::vector<float>(48000)), 0.5 * calc_energy(all.sound, std::vector<float>(48000))) << share;
  }
}

TEST(Budget, MoreOfItIsNearerToAll) {
  const Played all = play_hail(kUnlimited, 20.0, 0.5);
  const double energy = calc_energy(all.sound, std::vector<float>(all.sound.size()));
  double before = std::numeric_limits<double>::infinity();
  for (const double share : {0.05, 0.15, 0.3, 0.6, 0.9}) {
    const double difference =
        calc_energy(play_hail(share * 2.0 * static_cast<double>(all.counters.mode_samples), 20.0, 0.5).sound, all.sound);
    EXPECT_LT(difference, before) << share;
    before = difference;
  }
  EXPECT_LT(10.0 * std::log10(before / energy), -30.0);
  EXPECT_EQ(std::memcmp(play_hail(1e12, 20.0, 0.5).sound.data(), all.sound.data(), all.sound.size() * sizeof(float)), 0);
}

TEST(Budget, OneBodyOfManyModesKeepsAsManyAsThereIsRoomFor) {
  // A thousand modes, one strike, room for 208: no fewer may stay, whatever it took to wake them.
  const bank::Bank bank = make_bank(1000, 200.0, 20000.0, 3.0, 1e-3);
  const auto model = Model::make(bank, {.rate_hz = kRate});
  Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{0, 0, 0}}, .budget = 208.0 * kRate});
  const int body = synthesiser.add_body(model, {.position_m = {0, 1, 0}, .effects = {Effect::kModal, Effect::kHertzPulse}});
  synthesiser.push(events::Impulse{
      .time_s = 0.001, .body = body, .triangle = 0, .barycentric = {1, 0, 0}, .impulse_n_s = {0, 0, 1}, .duration_s = 1e-4});
  std::vector<float> block(4800);
  float* out = block.data();
  synthesiser.process(&out, 1, 4800);
  const std::int64_t before = synthesiser.get_counters().mode_samples;
  synthesiser.process(&out, 1, 4800);
  EXPECT_NEAR(static_cast<double>(synthesiser.get_counters().mode_samples - before), 208.0 * 4800, 16.0 * 4800);
}

TEST(Budget, GivesTheSameBitsInBlocksOfAnySize) {
  const double budget = 3e7;
  const Played whole = play_hail(budget, 50.0, 0.4, {4096});
  EXPECT_GT(whole.counters.faded, 100);
  for (const std::vector<int>& blocks : {std::vector<int>{1}, {64}, {33, 700, 5}}) {
    const Played parts = play_hail(budget, 50.0, 0.4, blocks);
    EXPECT_EQ(std::memcmp(whole.sound.data(), parts.sound.data(), whole.sound.size() * sizeof(float)), 0);
    EXPECT_EQ(whole.counters.mode_samples, parts.counters.mode_samples);
    EXPECT_EQ(whole.counters.faded, parts.counters.faded);
  }
}

/// One body struck at 10 ms; the budget falls to `groups` groups at 40 ms.
std::vector<float> play_cut(const std::shared_ptr<const Model>& model, int groups, int frames) {
  Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{0, 0, 0}}});
  const int body = synthesiser.add_body(model, {.position_m = {0.0, 1.0, 0.0}});
  EXPECT_TRUE(synthesiser.push(events::Impulse{.time_s = 0.01, .body = body, .triangle = 4, .impulse_n_s = {0, 0, 1e-3}}));
  std::vector<float> sound(frames);
  float* at = sound.data();
  synthesiser.process(&at, 1, 1920);
  if (groups > 0) synthesiser.set_budget((groups + 0.5) * kGroup * kRate);
  at += 1920;
  synthesiser.process(&at, 1, frames - 1920);
  return sound;
}

// The lost energy is that of the faded modes: by closed forms, integrated from the cut on.
TEST(Budget, LosesOnlyTheEnergyOfTheFadedModes) {
  constexpr double kDecay = 8.0, kSlope = 0.02;
  constexpr int kModes = 128, kStay = 3;
  const bank::Bank bank = make_bank(kModes, 200.0, 16000.0, kDecay, kSlope);
  const auto model = Model::make(bank, {.rate_hz = kRate});
  const std::vector<float> all = play_cut(model, 0, 48000), cut = play_cut(model, kStay, 48000);
  double expected = 0.0, sounding = 0.0;  // Pa^2 samples
  const double until = std::exp(-2.0 * kDecay * 0.03), last = std::exp(-2.0 * kDecay * 0.99);
  for (int m = 0; m < kModes; ++m) {
    const double amplitude = 1e-3 * std::pow(10.0, -m * kSlope);  // all corners move alike: phi . n = 1
    const double energy = amplitude * amplitude * kRate / (4.0 * kDecay) * (until - last);
    (m < kStay * kGroup ? sounding : expected) += energy;
  }
  const double difference = calc_energy(all, cut);
  EXPECT_LT(difference, 1.02 * expected);
  EXPECT_GT(difference, 0.8 * expected);
  for (std::size_t n = 0; n < 1920; ++n) ASSERT_EQ(all[n], cut[n]);
  double stays = 0.0;
  for (std::size_t n = 1920; n < cut.size(); ++n) stays += cut[n] * cut[n];
  EXPECT_NEAR(stays, sounding, 0.1 * sounding);
}

/// Level of one frequency in a Hann window of 2048 samples from `first` on.
double calc_level_db(const std::vector<float>& sound, std::size_t first, double freq_hz) {
  std::complex<double> sum = 0.0;
  for (std::size_t n = 0; n < 2048; ++n)
    sum += static_cast<double>(sound[first + n]) * (0.5 - 0.5 * std::cos(2 * pi * n / 2048.0)) *
           std::polar(1.0, -2 * pi * freq_hz * n / kRate);
  return 20.0 * std::log10(std::abs(sum) / 512.0 + 1e-30);
}

// All modes are below 3 kHz: anything above around the cut is a click.
TEST(Budget, FadesWithoutAClick) {
  const auto model = Model::make(make_bank(96, 300.0, 3000.0, 3.0, 0.0), {.rate_hz = kRate});
  const std::vector<float> sound = play_cut(model, 1, 9600);
  const double ringing_db = 20.0 * std::log10(1e-3);  // of one mode
  for (double freq = 8000.0; freq < 23000.0; freq += 333.0)
    EXPECT_LT(calc_level_db(sound, 1920 - 1024 + 280 / 2, freq), ringing_db - 60.0) << freq;
  // The same cut at once is a click that this sees.
  std::vector<float> hard = sound;
  std::fill(hard.begin() + 2000, hard.end(), 0.0F);
  EXPECT_GT(calc_level_db(hard, 1920 - 1024 + 280 / 2, 8333.0), ringing_db - 60.0);
}

TEST(Budget, ModesComeBackWithTheNextStrikeWhenThereIsRoomAgain) {
  const auto model = Model::make(make_bank(320, 300.0, 3000.0, 3.0, 0.0), {.rate_hz = kRate});
  Synthesiser synthesiser({.rate_hz = kRate, .budget = 40.0 * kGroup * kRate});
  const int body = synthesiser.add_body(model, {.position_m = {0.0, 1.0, 0.0}});
  std::vector<float> left(4800), right(4800);
  const std::array<float*, 2> out{left.data(), right.data()};
  const auto strike_and_count = [&](int blocks) {
    EXPECT_TRUE(
        synthesiser.push(events::Impulse{.time_s = synthesiser.get_horizon_s() + 0.001, .body = body, .impulse_n_s = {0, 0, 1e-3}}));
    std::int64_t last = 0;
    for (int i = 0; i < blocks; ++i) {
      const std::int64_t before = synthesiser.get_counters().mode_samples;
      synthesiser.process(out.data(), 2, 4800 / 128 * 128);
      last = synthesiser.get_counters().mode_samples - before;
    }
    return static_cast<double>(last) / (4800 / 128 * 128);
  };
  EXPECT_EQ(strike_and_count(3), 320.0);
  synthesiser.set_budget(10.9 * kGroup * kRate);
  synthesiser.process(out.data(), 2, 4800);
  EXPECT_EQ(strike_and_count(3), 160.0);
  synthesiser.set_budget(40.0 * kGroup * kRate);
  synthesiser.process(out.data(), 2, 4800);
  EXPECT_EQ(strike_and_count(3), 320.0);
  synthesiser.set_budget(0.0);
  EXPECT_EQ(strike_and_count(3), 16.0);  // never the first group
  synthesiser.set_budget(std::numeric_limits<double>::quiet_NaN());
  EXPECT_EQ(strike_and_count(3), 16.0);
  synthesiser.set_budget(kUnlimited);
  EXPECT_EQ(strike_and_count(3), 320.0);
}

// Of two equal bodies the farther one loses its modes first.
TEST(Budget, DistanceCounts) {
  const bank::Bank bank = make_bank(96, 300.0, 3000.0, 1.0, 0.0);
  const auto model = Model::make(bank, {.rate_hz = kRate});
  const auto play = [&](std::vector<int> struck, double budget) {
    Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{0, 0, 0}}, .budget = budget});
    synthesiser.add_body(model, {.position_m = {0.0, 12.0, 0.0}});
    synthesiser.add_body(model, {.position_m = {0.0, 1.0, 0.0}});
    for (const int body : struck) EXPECT_TRUE(synthesiser.push(events::Impulse{.time_s = 0.01, .body = body, .impulse_n_s = {0, 0, 1e-3}}));
    std::vector<float> sound(24000);
    float* at = sound.data();
    synthesiser.process(&at, 1, 24000);
    return sound;
  };
  const std::vector<float> both = play({0, 1}, 7.5 * kGroup * kRate), near = play({1}, kUnlimited), far = play({0}, kUnlimited);
  std::vector<float> rest(both.size());
  for (std::size_t n = 0; n < both.size(); ++n) rest[n] = both[n] - near[n];  // remainder of the far one
  const double left = calc_energy(rest, std::vector<float>(rest.size())), of_far = calc_energy(far, std::vector<float>(far.size()));
  EXPECT_LT(left, 0.35 * of_far);
  EXPECT_GT(left, 0.05 * of_far);
}

}  // namespace
}  // namespace carillon::synth
