// ResonatorBank against closed forms, quadrature and the exact map of each mode in double precision; its guarantees to the host.
#include "runtime/synth/resonator_bank.hpp"

#include <gtest/gtest.h>
#if defined(__x86_64__)
#include <xmmintrin.h>
#endif

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <numbers>
#include <numeric>
#include <random>
#include <utility>
#include <vector>

#include "runtime/synth/oscillator.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"
#include "tests/unit/runtime/synth/quadrature.hpp"
#include "tests/unit/runtime/synth/reference.hpp"

namespace carillon::synth {
namespace {

using std::numbers::pi;
using testing::calc_velocity;
using testing::InventedMode;
using testing::make_cube_bank;
using testing::make_many_modes;
constexpr double kRate = 48000.0;
const Vec3 kUnitImpulse{0.0, 0.0, 1.0};

std::shared_ptr<const Model> make_model(const bank::Bank& bank, double rate_hz = kRate) { return Model::make(bank, {.rate_hz = rate_hz}); }

std::vector<float> play(ResonatorBank& voice, std::size_t samples, std::size_t block = 256) {
  std::vector<float> pressure(samples, 0.0F);
  for (std::size_t n = 0; n < samples; n += block) voice.process(std::span(pressure).subspan(n, std::min(block, samples - n)));
  return pressure;
}

double calc_level(const std::vector<float>& sound) {
  return std::sqrt(std::inner_product(sound.begin(), sound.end(), sound.begin(), 0.0) / static_cast<double>(sound.size()));
}

double calc_projection(const bank::Bank& bank, const events::Impulse& strike, std::size_t mode) {
  double sum = 0.0;
  for (std::size_t corner = 0; corner < 3; ++corner) {
    const auto shape = bank.shape_at(bank.triangles[strike.triangle][corner], mode);
    sum += strike.barycentric[corner] * std::inner_product(shape.begin(), shape.end(), strike.impulse_n_s.begin(), 0.0);
  }
  return sum;
}

TEST(ResonatorBank, AnImpulseRingsLikeTheClosedFormInAllRegimes) {
  for (const auto& row : testing::read_impulse_reference()) {
    bank::Bank bank = make_cube_bank({{1000.0, 0.0}});
    bank.eigenvalue_rad2_s2[0] = row.lambda;
    bank.decay_per_s[0] = row.decay_per_s();
    ResonatorBank voice(make_model(bank));
    ASSERT_EQ(voice.get_model().get_mode_count(), 1) << row;
    const auto n = static_cast<std::size_t>(std::ceil(row.time_s * kRate)) + 5;
    ASSERT_TRUE(voice.strike({.time_s = static_cast<double>(n) / kRate - row.time_s, .impulse_n_s = kUnitImpulse}));
    EXPECT_NEAR(play(voice, n + 1)[n], row.q_dot, 1e-6) << row;
  }
}

TEST(ResonatorBank, AnImpulseBetweenSamplesHasItsAnalyticPhase) {
  const bank::Bank bank = make_cube_bank({{440.0, 3.0}, {9876.5, 40.0}, {23900.0, 0.0}});
  for (const double at : {0.0, 100.37, 100.0, 100.999, 127.5, 128.0001}) {
    ResonatorBank voice(make_model(bank));
    voice.strike({.time_s = at / kRate, .impulse_n_s = kUnitImpulse});
    const std::vector<float> pressure = play(voice, 400);
    for (int n = 0; n < 400; ++n) {
      const double t = (n - at) / kRate;
      const double expected = calc_velocity(440.0, 3.0, t) + calc_velocity(9876.5, 40.0, t) + calc_velocity(23900.0, 0.0, t);
      ASSERT_NEAR(pressure[n], expected, 5e-6) << "impulse at " << at << ", sample " << n;
      if (t < 0.0) {
        ASSERT_EQ(pressure[n], 0.0F);
      }
    }
  }
}

TEST(ResonatorBank, BothPulsesMatchQuadratureBeforeDuringAndAfter) {
  for (const PulseShape shape : {PulseShape::kHertz, PulseShape::kGaussian}) {
    for (const auto& [freq, decay] :
         {std::pair{440.0, 3.0}, {5000.0, 30.0}, {19900.0, 100.0}, {3000.0, 18000.0}, {1000.0, 7000.0}, {1000.0, 40000.0}}) {
      const bank::Bank bank = make_cube_bank({{freq, decay}});
      for (const double tau : {4e-6, 30e-6, 100e-6, 1.1e-3}) {
        ResonatorBank voice(make_model(bank));
        const double at = 80.37, length = calc_pulse_length(shape, tau);
        voice.strike({.time_s = at / kRate, .shape = shape, .impulse_n_s = kUnitImpulse, .duration_s = tau});
        const std::vector<float> pressure = play(voice, 200, 17);
        const double begin = at / kRate - length / 2;
        for (int n = 0; n < 200; ++n) {
          const double now = n / kRate;
          const double until = std::min(1.0, (now - begin) / length);
          const auto force = [&](double x) {
            return shape == PulseShape::kHertz ? testing::calc_reference_pulse(x) : calc_pulse(shape, x);
          };
          const double expected =
              until <= 0.0 ? 0.0
                           : testing::integrate([&](double x) { return force(x) * calc_velocity(freq, decay, now - begin - x * length); },
                                                0.0, until);
          ASSERT_NEAR(pressure[n], expected, 2e-6) << freq << " Hz, tau " << tau << ", sample " << n;
          if (until <= 0.0) {
            ASSERT_EQ(pressure[n], 0.0F);
          }
        }
      }
    }
  }
}

/// Pressure by the exact map of each mode over eighths of a sample, the pulses by their moments; strikes lie in triangles of the bank.
std::vector<double> calc_sound(const bank::Bank& bank, const std::vector<events::Impulse>& strikes, int samples) {
  constexpr double kParts = 8.0, h = 1.0 / (kParts * kRate);
  const int steps = static_cast<int>(kParts) * samples;
  std::vector<std::vector<std::pair<int, Moments>>> moments(steps);  // of each step, by the strike
  for (int i = 0; i < std::ssize(strikes); ++i) {
    const double length = strikes[i].duration_s / h, begin = strikes[i].time_s / h - 0.5 * length;
    for (int n = std::max(0, static_cast<int>(begin)); n <= begin + length + 1.0; ++n)
      moments[n].emplace_back(i, calc_pulse_moments(PulseShape::kHertz, begin - (n - 1), length));
  }
  std::vector<double> pressure(samples, 0.0);
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    const double lambda = bank.eigenvalue_rad2_s2[m], decay = bank.decay_per_s[m];
    const OscillatorMap step = calc_oscillator_map(lambda, decay, h);
    std::array<double, kMoments> answer_q{}, answer_v{};
    for (int k = 0; k < kMoments; ++k) {
      const OscillatorMap rest = calc_oscillator_map(lambda, decay, (1.0 - get_chebyshev_points()[k]) * h);
      answer_q[k] = rest.qv, answer_v[k] = rest.vv;
    }
    const Moments by_q = calc_chebyshev_coefficients(answer_q), by_v = calc_chebyshev_coefficients(answer_v);
    double q = 0.0, v = 0.0;
    for (int n = 0; n < steps; ++n) {
      const double before = q;
      q = step.qq * before + step.qv * v;
      v = step.vq * before + step.vv * v;
      for (const auto& [i, moment] : moments[n]) {
        const double push = calc_projection(bank, strikes[i], m);
        q += push * std::inner_product(moment.begin(), moment.end(), by_q.begin(), 0.0);
        v += push * std::inner_product(moment.begin(), moment.end(), by_v.begin(), 0.0);
      }
      if (n % 8 == 0) pressure[n / 8] += bank.radiation_gain[m] * v;
    }
  }
  return pressure;
}

TEST(ResonatorBank, SoundsAsTheExactMapOfEachMode) {
  std::vector<InventedMode> modes = make_many_modes(75);
  modes.push_back({23500.0, 4e5, 0.3, {0.2, 0.1, -0.4}, 0.05});  // over-damped
  const bank::Bank bank = make_cube_bank(modes);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> number(0.0, 1.0);
  std::vector<events::Impulse> strikes;
  for (int i = 0; i < 60; ++i) {
    const double time_s = number(random) * 0.5, duration_s = i % 5 == 0 ? 0.0 : std::pow(10.0, -5.0 + 2.3 * number(random));
    const auto triangle = static_cast<std::int32_t>(12 * number(random));
    const Vec3 impulse{number(random) - 0.5, number(random) - 0.5, number(random) - 0.5};
    strikes.push_back(
        {.time_s = time_s, .triangle = triangle, .barycentric = {0.2, 0.3, 0.5}, .impulse_n_s = impulse, .duration_s = duration_s});
  }
  const std::vector<double> slow = calc_sound(bank, strikes, 36000);
  for (const Isa isa : base::list_instructions()) {
    ResonatorBank voice(make_model(bank), {.isa = isa});
    for (const events::Impulse& strike : strikes) voice.strike(strike);
    const std::vector<float> fast = play(voice, 36000);
    double error = 0.0, size = 0.0;
    for (std::size_t n = 0; n < slow.size(); ++n) error += (fast[n] - slow[n]) * (fast[n] - slow[n]), size += slow[n] * slow[n];
    EXPECT_LT(10 * std::log10(error / size), -120.0) << get_name(isa);
    EXPECT_EQ(voice.get_counters().accepted, std::ssize(strikes));
    EXPECT_EQ(voice.get_counters().late, 0);
  }
}

TEST(ResonatorBank, EnergyIsThatOfTheImpulseAndStaysWithoutDamping) {
  std::vector<InventedMode> modes = make_many_modes(21);
  for (auto& mode : modes) mode.decay_per_s = 0.0;
  const bank::Bank bank = make_cube_bank(modes);
  ResonatorBank voice(make_model(bank));
  const events::Impulse strike{.time_s = 3.3 / kRate, .triangle = 4, .barycentric = {0.2, 0.3, 0.5}, .impulse_n_s = {0.01, 0.02, -0.03}};
  voice.strike(strike);
  play(voice, kBlock);
  double expected = 0.0;
  for (std::size_t m = 0; m < bank.mode_count(); ++m) expected += 0.5 * std::pow(calc_projection(bank, strike, m), 2);
  EXPECT_NEAR(voice.calc_energy_j(), expected, 1e-6 * expected);
  const double before = voice.calc_energy_j();
  play(voice, 8192 * kBlock, 4096);
  EXPECT_NEAR(voice.calc_energy_j(), before, 1e-9 * before);
}

TEST(ResonatorBank, BlockSizesDoNotChangeABit) {
  std::vector<InventedMode> modes = make_many_modes(137);
  modes.push_back({23600.0, 3e5});
  const auto model = make_model(make_cube_bank(modes));
  const auto render = [&](auto next_block) {
    ResonatorBank voice(model);
    for (int i = 0; i < 40; ++i) {
      voice.strike({.time_s = (10.0 + 1431.7 * i) / kRate,
                    .triangle = i % 12,
                    .shape = i % 3 == 0 ? PulseShape::kGaussian : PulseShape::kHertz,
                    .barycentric = {0.1, 0.2, 0.7},
                    .impulse_n_s = {0.1 * i, 0.0, 1.0},
                    .duration_s = 40e-6 * i});
    }
    std::vector<float> sound(5 * 48000, 0.0F);
    for (std::size_t n = 0; n < sound.size();) {
      const std::size_t size = std::min<std::size_t>(next_block(), sound.size() - n);
      voice.process(std::span(sound).subspan(n, size));
      n += size;
    }
    return sound;
  };
  const std::vector<float> expected = render([] { return 128; });
  ASSERT_GT(calc_level(expected), 1e-3);
  for (const int block : {1, 7, 31, 32, 33, 64, 127, 511, 4096}) {
    const std::vector<float> sound = render([block] { return block; });
    EXPECT_EQ(std::memcmp(sound.data(), expected.data(), sizeof(float) * sound.size()), 0) << "blocks of " << block;
  }
  std::mt19937 random(11);
  const std::vector<float> sound = render([&random] { return std::uniform_int_distribution<int>(1, 700)(random); });
  EXPECT_EQ(std::memcmp(sound.data(), expected.data(), sizeof(float) * sound.size()), 0);
}

TEST(ResonatorBank, ModesAtOrAboveNyquistAreNeverSounded) {
  const bank::Bank bank = make_cube_bank({{1000.0, 1.0}, {23999.0, 1.0}, {24000.0, 1.0}, {24001.0, 1.0}, {60000.0, 1.0}});
  EXPECT_EQ(make_model(bank, 48000.0)->get_mode_count(), 2);
  EXPECT_EQ(make_model(bank, 44100.0)->get_mode_count(), 1);
  EXPECT_EQ(make_model(bank, 192000.0)->get_mode_count(), 5);
  // A damped frequency in range does not help: undamped 30 kHz, damped 10 kHz.
  EXPECT_EQ(make_model(make_cube_bank({{30000.0, 2 * pi * std::sqrt(8e8)}}))->get_mode_count(), 0);
}

TEST(ResonatorBank, TheDirectionOfTheImpulseIsKept) {
  const auto model = make_model(make_cube_bank({{1000.0, 1.0, 1.0, {1.0, 0.0, 0.0}}}));
  const auto first = [&](const Vec3& impulse) {
    ResonatorBank voice(model);
    voice.strike({.impulse_n_s = impulse});
    return play(voice, 1)[0];
  };
  EXPECT_NEAR(first({1.0, 0.0, 0.0}), 1.0, 1e-6);
  EXPECT_EQ(first({0.0, 1.0, 1.0}), 0.0F);
  EXPECT_EQ(first({0.0, 0.0, 0.0}), 0.0F);
  EXPECT_NEAR(first({0.6, 0.8, 0.0}), 0.6, 1e-6);
  EXPECT_EQ(first({-0.6, 0.8, 0.0}), -first({0.6, -0.8, 0.0}));
}

TEST(ResonatorBank, ModesAreInTheOrderOfAudibility) {
  // By hand: level over silence in nepers / decay.
  const bank::Bank bank =
      make_cube_bank({{100.0, 50.0, 1.0}, {200.0, 5.0, 1.0}, {300.0, 1.0, 1e-9}, {400.0, 0.0, 1.0}, {500.0, 5.0, 0.0}, {600.0, 4e4, 1.0}});
  const auto model = make_model(bank);
  std::vector<int> order;
  for (int m = 0; m < model->get_mode_count(); ++m) order.push_back(model->get_bank_mode(m));
  EXPECT_EQ(order, (std::vector<int>{3, 1, 0, 2, 4, 5}));
  EXPECT_EQ(model->get_decay_per_s(1), 5.0);
  EXPECT_EQ(model->get_gain(3), 1e-9);
  EXPECT_NEAR(model->get_eigenvalue_rad2_s2(0), std::pow(2 * pi * 400.0, 2), 1e-3);
}

TEST(ResonatorBank, TheAudibleModesAreTheFirstOnes) {
  const bank::Bank bank = make_cube_bank(make_many_modes(320));
  const auto model = make_model(bank);
  const double silence = 1e-10;
  ResonatorBank voice(model, {.silence_pa = silence});
  voice.strike({.impulse_n_s = {0.0, 0.0, 1e-3}});
  int before = model->get_mode_count();
  for (int turn = 1; turn <= 400; ++turn) {
    play(voice, 1024, 128);
    const double t = turn * 1024 / kRate;
    const int live = voice.get_active_mode_count();
    EXPECT_LE(live, before);
    before = live;
    double lost = 0.0;  // of the modes that are gone, by the closed form
    for (int m = live; m < model->get_mode_count(); ++m) {
      lost += 1e-2 * 1e-3 * std::exp(-model->get_decay_per_s(m) * t);
    }
    EXPECT_LT(lost, silence) << t << " s";
  }
  EXPECT_LT(before, 33);
}

TEST(ResonatorBank, FallsAsleepAndWakesAgain) {
  ResonatorBank voice(make_model(make_cube_bank(make_many_modes(40))));
  EXPECT_FALSE(voice.is_awake());
  voice.strike({.time_s = 100.0 / kRate, .impulse_n_s = kUnitImpulse});
  play(voice, 1024);
  EXPECT_EQ(voice.get_active_mode_count(), 40);
  play(voice, 48000);
  EXPECT_LT(voice.get_active_mode_count(), 40);
  EXPECT_GT(voice.get_active_mode_count(), 0);
  play(voice, 48000 * 20);
  EXPECT_FALSE(voice.is_awake());
  EXPECT_EQ(voice.calc_energy_j(), 0.0);
  const std::int64_t work = voice.get_counters().mode_samples;
  EXPECT_EQ(calc_level(play(voice, 48000)), 0.0);
  EXPECT_EQ(voice.get_counters().mode_samples, work);
  voice.strike({.time_s = (static_cast<double>(voice.get_horizon()) + 0.5) / kRate, .impulse_n_s = kUnitImpulse});
  EXPECT_GT(calc_level(play(voice, 100)), 0.0);
  EXPECT_TRUE(voice.is_awake());
}

TEST(ResonatorBank, ALimitFadesTheLastModesOutAndKeepsTheFirst) {
  const bank::Bank bank = make_cube_bank(make_many_modes(96));
  const auto model = make_model(bank);
  const auto render = [&](bool limited) {
    ResonatorBank voice(model);
    voice.strike({.impulse_n_s = kUnitImpulse});
    std::vector<float> sound = play(voice, 1280);
    if (limited) voice.set_max_modes(40);  // three groups
    const std::vector<float> later = play(voice, 1280, 96);
    EXPECT_EQ(voice.get_active_mode_count(), limited ? 48 : 96);
    sound.insert(sound.end(), later.begin(), later.end());
    return sound;
  };
  const std::vector<float> whole = render(false), limited = render(true);
  for (int n = 0; n < 2560; ++n) {
    const double part = n < 1280 ? 1.0 : std::max(0.0, 1.0 - (n - 1280) / 128.0);
    double expected = 0.0;
    for (int m = 0; m < 96; ++m) {
      const int mode = model->get_bank_mode(m);
      const double level = bank.radiation_gain[mode] * bank.shape_at(0, mode)[2];
      expected += (m < 48 ? 1.0 : part) * level *
                  calc_velocity(std::sqrt(model->get_eigenvalue_rad2_s2(m)) / (2 * pi), model->get_decay_per_s(m), n / kRate);
    }
    ASSERT_NEAR(limited[n], expected, 2e-6) << n;
  }
  EXPECT_NE(whole, limited);
}

TEST(ResonatorBank, TheLimitStaysForLaterStrikesAndOneGroupAlwaysPlays) {
  ResonatorBank voice(make_model(make_cube_bank(make_many_modes(96))));
  voice.set_max_modes(0);
  voice.strike({.impulse_n_s = kUnitImpulse});
  play(voice, 256);
  EXPECT_EQ(voice.get_active_mode_count(), 16);
  voice.set_max_modes(1000);
  voice.strike({.time_s = 300.0 / kRate, .impulse_n_s = kUnitImpulse});
  play(voice, 256);
  EXPECT_EQ(voice.get_active_mode_count(), 96);
}

TEST(ResonatorBank, BadStrikesAreRefusedAndOverflowIsCleared) {
  ResonatorBank voice(make_model(make_cube_bank({{1000.0, 1.0}, {2000.0, 1.0, 1e30}})), {.max_strikes = 4});
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(voice.strike({.time_s = nan}));
  EXPECT_FALSE(voice.strike({.duration_s = -1.0}));
  EXPECT_FALSE(voice.strike({.triangle = 12}));
  EXPECT_FALSE(voice.strike({.triangle = -1}));
  EXPECT_FALSE(voice.strike({.barycentric = {nan, 0.0, 0.0}}));
  EXPECT_FALSE(voice.strike({.impulse_n_s = {0.0, std::numeric_limits<double>::infinity(), 0.0}}));
  EXPECT_EQ(voice.get_counters().refused, 6);
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(voice.strike({.time_s = 10.0 / kRate, .impulse_n_s = {0.0, 0.0, 1e30}}));
  EXPECT_FALSE(voice.strike({.time_s = 10.0 / kRate}));
  for (const float p : play(voice, 200)) ASSERT_TRUE(std::isfinite(p));
  EXPECT_EQ(voice.get_counters().resets, 1);
  EXPECT_TRUE(voice.strike({.time_s = 300.0 / kRate, .impulse_n_s = {0.0, 0.0, 1e-3}}));
  EXPECT_NE(play(voice, 200)[150], 0.0F);
}

TEST(ResonatorBank, ALateStrikeSoundsAtTheHorizonWithItsWholeImpulse) {
  ResonatorBank voice(make_model(make_cube_bank({{1000.0, 0.0}})));
  play(voice, 1000, 1000);
  EXPECT_EQ(voice.get_position(), 1000);
  EXPECT_EQ(voice.get_horizon(), 1024);
  voice.strike({.time_s = 200.0 / kRate, .impulse_n_s = kUnitImpulse});
  EXPECT_EQ(voice.get_counters().late, 1);
  const std::vector<float> sound = play(voice, 24 + kBlock);
  for (int n = 0; n < 24; ++n) EXPECT_EQ(sound[n], 0.0F);
  EXPECT_NE(sound[24], 0.0F);
  EXPECT_NEAR(voice.calc_energy_j(), 0.5, 1e-6);
}

TEST(ResonatorBank, AddsToTheBlock) {
  const auto model = make_model(make_cube_bank(make_many_modes(20)));
  ResonatorBank voice(model), again(model);
  voice.strike({.impulse_n_s = kUnitImpulse});
  again.strike({.impulse_n_s = kUnitImpulse});
  std::vector<float> zero(200, 0.0F), two(200, 2.0F);
  voice.process(zero);
  again.process(two);
  for (std::size_t n = 0; n < 200; ++n) EXPECT_EQ(two[n], 2.0F + zero[n]);
}

#if defined(__x86_64__)
TEST(ResonatorBank, DenormalsAreFlushedInsideAndTheCallersSettingComesBack) {
  ResonatorBank voice(make_model(make_cube_bank({{1000.0, 2000.0}})), {.silence_pa = 1e-300});
  voice.strike({.impulse_n_s = kUnitImpulse});
  const unsigned before = _mm_getcsr() & ~0x3FU;  // without the exception flags
  for (int i = 0; i < 400; ++i) {
    for (const float p : play(voice, 128)) ASSERT_NE(std::fpclassify(p), FP_SUBNORMAL);
  }
  EXPECT_EQ(_mm_getcsr() & ~0x3FU, before);
}
#endif

TEST(ResonatorBank, BadBanksAndNumbersAreRefused) {
  const bank::Bank good = make_cube_bank({{1000.0, 1.0}});
  bank::Bank bank = good;
  bank.shape.pop_back();
  EXPECT_THROW(make_model(bank), InputError);
  bank = good;
  bank.triangles[3][1] = 8;
  EXPECT_THROW(make_model(bank), InputError);
  EXPECT_THROW(make_model(good, 0.0), InputError);
  EXPECT_THROW(make_model(good, std::numeric_limits<double>::infinity()), InputError);
  const std::vector<double> two{1.0, 2.0};
  EXPECT_THROW(Model::make(good, {.gains = two}), InputError);
  EXPECT_THROW(Model::make(good, {.silence_pa = 0.0}), InputError);
  EXPECT_THROW(ResonatorBank(make_model(good), {.silence_pa = -1.0}), InputError);
}

TEST(ResonatorBank, OtherGainsReplaceThoseOfTheBank) {
  const bank::Bank bank = make_cube_bank({{1000.0, 1.0, 1.0}});
  const std::vector<double> gains{0.25};
  ResonatorBank own(make_model(bank)), other(Model::make(bank, {.gains = gains}));
  own.strike({.impulse_n_s = kUnitImpulse});
  other.strike({.impulse_n_s = kUnitImpulse});
  const std::vector<float> a = play(own, 300), b = play(other, 300);
  for (std::size_t n = 0; n < a.size(); ++n) ASSERT_NEAR(b[n], 0.25F * a[n], 1e-7);
}

}  // namespace
}  // namespace carillon::synth
