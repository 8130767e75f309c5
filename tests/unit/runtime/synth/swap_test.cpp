// Model swaps: frequencies by the formulas, energy kept, no click, no leaks.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <memory>
#include <numbers>
#include <vector>

#include "runtime/bank/edits.hpp"
#include "runtime/base/error.hpp"
#include "runtime/synth/synthesiser.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::synth {
namespace {

using std::numbers::pi;
constexpr double kRate = 48000.0;
constexpr int kSwap = 7680;  // sample at which the sound of the new model begins: 60 blocks

std::shared_ptr<const Model> make_model(const bank::Bank& bank) { return Model::make(bank, {.rate_hz = kRate}); }

/// One microphone at 48 samples of travel time: sample n arrives at n + 48 + kLatency.
constexpr double kDistanceM = 48.0 * kSoundSpeedMs / kRate;
constexpr int kDelay = 48 + Synthesiser::kLatency;

std::vector<float> play(Synthesiser& synthesiser, int frames) {
  std::vector<float> out(frames);
  float* at = out.data();
  synthesiser.process(&at, 1, frames);
  return out;
}

events::Impulse make_impulse(int body, double time_s) {
  return {
      .time_s = time_s, .body = body, .triangle = 4, .barycentric = {0.2, 0.3, 0.5}, .impulse_n_s = {0.0, 0.0, 1e-2}, .duration_s = 2e-4};
}

/// Struck at 1 ms, swapped at sample kSwap; pressure at 1 m as rendered.
std::vector<float> play_swap(const bank::Bank& before, const bank::Bank& after, int frames) {
  Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{0, 0, 0}}});
  const int body = synthesiser.add_body(make_model(before), {.position_m = {0.0, kDistanceM, 0.0}});
  EXPECT_TRUE(synthesiser.push(make_impulse(body, 0.001)));
  std::vector<float> sound = play(synthesiser, kSwap);
  synthesiser.swap_model(body, make_model(after));
  const std::vector<float> rest = play(synthesiser, frames + kDelay - kSwap);
  sound.insert(sound.end(), rest.begin(), rest.end());
  sound.erase(sound.begin(), sound.begin() + kDelay);
  for (float& p : sound) p *= static_cast<float>(kDistanceM);
  return sound;
}

/// Amplitude and phase of a sinusoid in a Hann window of `width` samples from `first` on; the phase is that at `first`.
std::complex<double> find_line(const std::vector<float>& sound, int first, int width, double freq_hz) {
  std::complex<double> sum = 0.0;
  for (int n = 0; n < width; ++n) {
    const double window = 0.5 - 0.5 * std::cos(2 * pi * n / width);
    sum += window * static_cast<double>(sound[first + n]) * std::polar(1.0, -2 * pi * freq_hz * n / kRate);
  }
  return sum * (4.0 / width);
}

/// Frequency near `near_hz` by the phase advance between two windows.
double find_frequency(const std::vector<float>& sound, int first, double near_hz) {
  constexpr int kWidth = 9600, kStep = 960;
  double freq = near_hz;
  for (int i = 0; i < 3; ++i) {
    const auto turn = find_line(sound, first + kStep, kWidth, freq) / find_line(sound, first, kWidth, freq) *
                      std::polar(1.0, -2 * pi * freq * kStep / kRate);
    freq += std::arg(turn) * kRate / (2 * pi * kStep);
  }
  return freq;
}

bank::Bank make_three() {
  bank::Bank bank = testing::make_cube_bank({{600.0, 4.0, 1.0, {0, 0, 1}}, {1310.0, 4.0, 0.5, {0, 0, 1}}, {2890.0, 4.0, 0.7, {0, 0, 1}}});
  bank.material.alpha2_per_s = 8.0;
  return bank;
}

TEST(Swap, FrequenciesAreThoseOfTheFormulas) {
  const bank::Bank bank = make_three();
  for (const bank::Edits& edits : {bank::Edits{.density_scale = 1.7},
                                   {.stiffness_scale = 0.6},
                                   {.size_scale = 1.25},
                                   {.size_scale = 0.5},
                                   {.density_scale = 0.8, .stiffness_scale = 2.0, .size_scale = 0.9}}) {
    const std::vector<float> sound = play_swap(bank, bank::calc_edited(bank, edits), 24000);
    const double pitch = std::sqrt(edits.stiffness_scale / edits.density_scale) / edits.size_scale;
    for (const double freq : {600.0, 1310.0, 2890.0}) {
      // The line is 4 Hz / pi wide by its decay, which moves no phase; others leak in at the windows' side lobes.
      EXPECT_NEAR(find_frequency(sound, kSwap + 500, freq * pitch) / (freq * pitch), 1.0, 2e-5) << freq;
      EXPECT_LT(std::abs(find_line(sound, kSwap + 500, 9600, freq)), 1e-3 * std::abs(find_line(sound, kSwap + 500, 9600, freq * pitch)));
    }
  }
}

TEST(Swap, DampingChangesAndNothingElse) {
  const bank::Bank bank = make_three();
  const bank::Bank after = bank::calc_edited(bank, {.alphas = {{0.0, 60.0}}});
  const std::vector<float> sound = play_swap(bank, after, 24000);
  for (const double freq : {600.0, 1310.0, 2890.0}) {
    const double fall = std::abs(find_line(sound, kSwap + 4800, 2400, freq)) / std::abs(find_line(sound, kSwap + 400, 2400, freq));
    EXPECT_NEAR(-std::log(fall) * kRate / 4400.0, 30.0, 0.1) << freq;
    EXPECT_NEAR(find_frequency(sound, kSwap + 400, freq), std::sqrt(freq * freq - std::pow(30.0 / (2 * pi), 2)), 0.002);
  }
}

// E = (q'^2 + lambda q^2) / 2 of each mode is continuous: so are its velocity, its pressure (gain times velocity) and its phase.
TEST(Swap, EnergyAndPhaseOfEachModeAreContinuous) {
  bank::Bank bank = make_three();
  for (double& decay : bank.decay_per_s) decay = 0.0;
  bank.material.alpha2_per_s = 0.0;
  const bank::Edits edits{.density_scale = 2.0, .size_scale = 0.8};
  const bank::Bank after = bank::calc_edited(bank, edits);
  const std::vector<float> sound = play_swap(bank, after, 24000);
  for (std::size_t m = 0; m < 3; ++m) {
    const double old_hz = bank.freq_hz(m), new_hz = after.freq_hz(m);
    constexpr int kWidth = 4800, kBefore = kSwap - 5000, kAfter = kSwap + 500;
    const auto old_line = find_line(sound, kBefore, kWidth, old_hz) * std::polar(1.0, 2 * pi * old_hz * (kSwap - kBefore) / kRate);
    const auto new_line = find_line(sound, kAfter, kWidth, new_hz) * std::polar(1.0, -2 * pi * new_hz * (kAfter - kSwap) / kRate);
    EXPECT_NEAR(std::abs(new_line) / std::abs(old_line), after.radiation_gain[m] / bank.radiation_gain[m],
                2e-3 * after.radiation_gain[m] / bank.radiation_gain[m]);
    EXPECT_NEAR(std::arg(new_line / old_line), 0.0, 0.01) << m;
  }
}

TEST(Swap, MakesNoClick) {
  // All modes are below 3 kHz before and after; anything above at the swap is a click.
  std::vector<testing::InventedMode> modes;
  for (int m = 0; m < 40; ++m) modes.push_back({300.0 + 40.0 * m, 3.0, 1.0, {0, 0, 1}});
  const bank::Bank bank = testing::make_cube_bank(modes);
  const std::vector<float> sound = play_swap(bank, bank::calc_edited(bank, {.density_scale = 0.5, .size_scale = 0.9}), 14000);
  constexpr int kWidth = 2048;
  const double ringing = std::abs(find_line(sound, kSwap - 4096, kWidth, 300.0 + 40.0 * 20));
  const auto find_click_db = [&](const std::vector<float>& heard) {
    double loudest = 0.0;
    for (double freq = 9000.0; freq < 23000.0; freq += 517.0)
      loudest = std::max(loudest, std::abs(find_line(heard, kSwap - kWidth / 2 + 64, kWidth, freq)));
    return 20.0 * std::log10(loudest / ringing);
  };
  EXPECT_LT(find_click_db(sound), -90.0);
  // A change of level by 1 dB at once, at the loudest of these samples, is a click that this sees.
  std::vector<float> hard = sound;
  const auto at = std::max_element(hard.begin() + kSwap, hard.begin() + kSwap + 128);
  std::transform(at, hard.end(), at, [](float p) { return 0.89F * p; });
  EXPECT_GT(find_click_db(hard), -80.0);
}

TEST(Swap, StrikesSoundAsOnTheNewModelAlone) {
  const bank::Bank bank = make_three(), edited = bank::calc_edited(bank, {.stiffness_scale = 3.0});
  const auto play_both = [&](bool swaps) {
    Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{0, 0, 0}}});
    const int body = synthesiser.add_body(make_model(swaps ? bank : edited), {.position_m = {0.0, kDistanceM, 0.0}});
    for (const double time_s : {kSwap / kRate, (kSwap + 100) / kRate, (kSwap + 1000.4) / kRate})
      EXPECT_TRUE(synthesiser.push(make_impulse(body, time_s)));
    play(synthesiser, kSwap - 128);
    if (swaps) synthesiser.swap_model(body, make_model(edited));  // silent, and one strike waits
    return play(synthesiser, 9600);
  };
  const std::vector<float> always = play_both(false), swapped = play_both(true);
  const float peak = *std::max_element(always.begin(), always.end());
  EXPECT_GT(peak, 1e-4F);
  for (std::size_t n = 0; n < always.size(); ++n) ASSERT_NEAR(swapped[n], always[n], 1e-6 * peak) << n;
}

TEST(Swap, ModesOfOneModelOnlyFadeOrBeginAtRest) {
  const bank::Bank bank = testing::make_cube_bank({{600.0, 2.0, 1.0, {0, 0, 1}}, {15000.0, 2.0, 1.0, {0, 0, 1}}});
  const bank::Bank small = bank::calc_edited(bank, {.size_scale = 0.5});  // 1200 Hz and 30 kHz, which cannot sound
  Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{0, 0, 0}}});
  const int body = synthesiser.add_body(make_model(bank), {.position_m = {0.0, 1.0, 0.0}});
  EXPECT_TRUE(synthesiser.push(make_impulse(body, 0.001)));
  std::vector<float> sound = play(synthesiser, 9600);
  const double level = std::abs(find_line(sound, 2400, 4800, 15000.0));
  EXPECT_GT(level, 1e-6);
  synthesiser.swap_model(body, make_model(small));
  play(synthesiser, 1280);
  sound = play(synthesiser, 9600);
  EXPECT_LT(std::abs(find_line(sound, 2400, 4800, 15000.0)), 1e-5 * level);
  EXPECT_GT(std::abs(find_line(sound, 2400, 4800, 1200.0)), 1e-6);
  synthesiser.swap_model(body, make_model(bank));
  play(synthesiser, 1280);
  sound = play(synthesiser, 9600);
  EXPECT_LT(std::abs(find_line(sound, 2400, 4800, 15000.0)), 1e-5 * level);  // lost modes do not return
  EXPECT_GT(std::abs(find_line(sound, 2400, 4800, 600.0)), 1e-6);
}

TEST(Swap, OverDampedModesChangeTheirKindWithoutAStep) {
  // At half the size the second mode, nearly critical, is an over-damped one of another class, and back.
  bank::Bank bank = testing::make_cube_bank({{500.0, 5.0, 1.0, {0, 0, 1}}, {900.0, 5000.0, 30.0, {0, 0, 1}}});
  bank::Bank over = bank;
  over.decay_per_s[1] = 9000.0;
  Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{0, 0, 0}}});
  const int body = synthesiser.add_body(make_model(bank), {.position_m = {0.0, 1.0, 0.0}});
  EXPECT_EQ(make_model(bank)->get_ringing_mode_count(), 2);
  EXPECT_EQ(make_model(over)->get_ringing_mode_count(), 1);
  for (int i = 0; i < 40; ++i) {
    EXPECT_TRUE(synthesiser.push(make_impulse(body, synthesiser.get_horizon_s() + 0.0011)));
    synthesiser.swap_model(body, make_model(i % 2 == 0 ? over : bank));
    const std::vector<float> sound = play(synthesiser, 128);
    for (const float p : sound) ASSERT_TRUE(std::isfinite(p));
  }
  EXPECT_EQ(synthesiser.get_counters().resets, 0);
  EXPECT_EQ(synthesiser.get_counters().strikes, 40);
}

TEST(Swap, TheOldModelIsFreed) {
  const bank::Bank bank = make_three();
  Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{0, 0, 0}}});
  auto first = make_model(bank);
  const std::weak_ptr<const Model> old = first;
  const int body = synthesiser.add_body(std::move(first), {.position_m = {0.0, 1.0, 0.0}});
  EXPECT_TRUE(synthesiser.push(make_impulse(body, 0.001)));
  play(synthesiser, 1000);
  synthesiser.collect();
  // Three at once: the first goes, the second never sounds, the third waits for the first.
  std::array<std::weak_ptr<const Model>, 3> made;
  for (auto& weak : made) {
    auto model = make_model(bank::calc_edited(bank, {.density_scale = 1.1}));
    weak = model;
    synthesiser.swap_model(body, std::move(model));
  }
  EXPECT_FALSE(old.expired());
  EXPECT_FALSE(made[0].expired());
  EXPECT_TRUE(made[1].expired());
  for (int i = 0; i < 3; ++i) {
    play(synthesiser, 200);
    synthesiser.collect();
  }
  EXPECT_TRUE(old.expired());
  EXPECT_TRUE(made[0].expired());
  EXPECT_FALSE(made[2].expired());
  // Also when the body goes while its new model is on its way.
  synthesiser.swap_model(body, make_model(bank));
  synthesiser.swap_model(body, make_model(bank));
  synthesiser.remove_body(body);
  EXPECT_THROW(synthesiser.swap_model(body, make_model(bank)), InputError);
  play(synthesiser, 300);
  synthesiser.collect();
  EXPECT_TRUE(made[2].expired());
}

TEST(Swap, SwapsEveryBlockForBodiesOfAnyEffects) {
  const bank::Bank bank = make_three();
  const auto model = make_model(bank), other = make_model(bank::calc_edited(bank, {.size_scale = 2.0}));
  for (const EffectSet effects : {EffectSet{}, EffectSet{Effect::kAccelerationNoise}, kDefaultEffects.with(Effect::kAccelerationNoise)}) {
    Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{0, 0, 0}}});
    const int body = synthesiser.add_body(model, {.position_m = {0.0, 1.0, 0.0}, .effects = effects});
    for (int i = 0; i < 60; ++i) {
      synthesiser.swap_model(body, i % 2 == 0 ? other : model);
      EXPECT_TRUE(synthesiser.push(make_impulse(body, synthesiser.get_horizon_s() + 0.002)));
      for (const float p : play(synthesiser, 77 + i)) ASSERT_TRUE(std::isfinite(p));
    }
    EXPECT_EQ(synthesiser.get_counters().refused, 0);
  }
}

TEST(Swap, SlidingContinues) {
  const bank::Bank bank = make_three();
  const auto model = make_model(bank), other = make_model(bank::calc_edited(bank, {.size_scale = 0.9}));
  Synthesiser synthesiser({.rate_hz = kRate, .microphones_m = {{0, 0, 0}}});
  const EffectSet effects{Effect::kModal, Effect::kRoughness, Effect::kRolling, Effect::kContactDamping};
  const int body = synthesiser.add_body(model, {.position_m = {0.0, 1.0, 0.0}, .effects = effects});
  for (int i = 0; i <= 100; ++i) {
    const auto state = i == 0 ? events::ContactState::kBegin : i == 100 ? events::ContactState::kEnd : events::ContactState::kHold;
    EXPECT_TRUE(synthesiser.push(events::LastingContact{.time_s = 0.01 * i,
                                                        .id = 3,
                                                        .body = body,
                                                        .state = state,
                                                        .normal = {0, 0, 1},
                                                        .slip_m_s = {0.4, 0, 0},
                                                        .force_n = 2.0,
                                                        .other_sweep_m_s = 0.4,
                                                        .patch_radius_m = 2e-4}));
  }
  EXPECT_TRUE(synthesiser.push(events::TimeWatermark{9.0}));
  std::vector<double> level;
  for (int i = 0; i < 20; ++i) {
    if (i >= 10) synthesiser.swap_model(body, i % 2 == 0 ? other : model);
    double sum = 0.0, peak = 0.0;
    for (const float p : play(synthesiser, 2400)) {
      ASSERT_TRUE(std::isfinite(p));
      sum += static_cast<double>(p) * static_cast<double>(p);
      peak = std::max(peak, static_cast<double>(std::abs(p)));
    }
    level.push_back(std::sqrt(sum / 2400));
    EXPECT_LT(peak, 8.0 * level.back()) << i;  // noise, and no click in it
    synthesiser.collect();
  }
  double before = 0.0, after = 0.0;
  for (int i = 5; i < 10; ++i) before += level[i] / 5;
  for (int i = 12; i < 20; ++i) after += level[i] / 8;
  EXPECT_GT(after, 0.3 * before);
  EXPECT_LT(after, 3.0 * before);
  EXPECT_EQ(synthesiser.get_counters().refused, 0);
}

TEST(Swap, RefusesImpossibleModels) {
  const bank::Bank bank = make_three();
  Synthesiser synthesiser({.rate_hz = kRate});
  const int body = synthesiser.add_body(make_model(bank));
  EXPECT_THROW(synthesiser.swap_model(body, nullptr), InputError);
  EXPECT_THROW(synthesiser.swap_model(5, make_model(bank)), InputError);
  EXPECT_THROW(synthesiser.swap_model(body, Model::make(bank, {.rate_hz = 44100.0})), InputError);
  // A bank with fewer triangles: the strike that waits on one that is gone is refused, and nothing worse.
  bank::Bank smaller = bank;
  smaller.triangles.resize(2);
  EXPECT_TRUE(synthesiser.push(make_impulse(body, 0.01)));
  std::vector<float> left(4800), right(4800);
  const std::array<float*, 2> out{left.data(), right.data()};
  synthesiser.process(out.data(), 2, 64);
  synthesiser.swap_model(body, make_model(smaller));
  synthesiser.process(out.data(), 2, 4800);
  EXPECT_EQ(*std::max_element(left.begin(), left.end()), 0.0F);
}

}  // namespace
}  // namespace carillon::synth
