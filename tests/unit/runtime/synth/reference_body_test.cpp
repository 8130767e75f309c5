#include "tests/unit/runtime/synth/reference_body.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <vector>

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
using testing::ReferenceBody;
constexpr double kRate = 48000.0;
const Vec3 kUnitImpulse{0.0, 0.0, 1.0};

std::vector<double> play(ReferenceBody& body, std::size_t samples, std::size_t block = 256) {
  std::vector<double> pressure(samples, 0.0);
  for (std::size_t n = 0; n < samples; n += block) body.process(std::span(pressure).subspan(n, std::min(block, samples - n)));
  return pressure;
}

TEST(ReferenceBody, AnImpulseRingsLikeTheClosedFormInAllRegimes) {
  for (const auto& row : testing::read_impulse_reference()) {
    bank::Bank bank = make_cube_bank({{1000.0, 0.0}});
    bank.eigenvalue_rad2_s2[0] = row.lambda;
    bank.decay_per_s[0] = row.decay_per_s();
    ReferenceBody body(bank, kRate);
    ASSERT_EQ(body.get_mode_count(), 1) << row;
    const auto n = static_cast<std::size_t>(std::ceil(row.time_s * kRate)) + 5;
    ASSERT_TRUE(body.strike({.sample = n - row.time_s * kRate, .impulse_n_s = kUnitImpulse}));
    EXPECT_NEAR(play(body, n + 1)[n], row.q_dot, 1e-10) << row;
  }
}

TEST(ReferenceBody, AnImpulseBetweenSamplesHasItsAnalyticPhase) {
  const bank::Bank bank = make_cube_bank({{440.0, 3.0}, {9876.5, 40.0}, {23900.0, 0.0}});
  for (const double at : {0.0, 100.37, 100.0, 100.999, 127.5, 128.0001}) {
    ReferenceBody body(bank, kRate);
    body.strike({.sample = at, .impulse_n_s = kUnitImpulse});
    const std::vector<double> pressure = play(body, 400);
    for (int n = 0; n < 400; ++n) {
      const double t = (n - at) / kRate;
      const double expected = calc_velocity(440.0, 3.0, t) + calc_velocity(9876.5, 40.0, t) + calc_velocity(23900.0, 0.0, t);
      ASSERT_NEAR(pressure[n], expected, 1e-9) << "impulse at " << at << ", sample " << n;
    }
  }
}

TEST(ReferenceBody, APulseMatchesQuadratureBeforeDuringAndAfter) {
  struct Case {
    double freq_hz, decay_per_s;
  };
  for (const Case c : {Case{440.0, 3.0}, {5000.0, 30.0}, {19900.0, 100.0}, {3000.0, 18000.0}}) {
    const bank::Bank bank = make_cube_bank({{c.freq_hz, c.decay_per_s}});
    for (const double tau : {4e-6, 30e-6, 100e-6, 1.1e-3}) {
      ReferenceBody body(bank, kRate);
      const double at = 40.37;
      body.strike({.sample = at, .duration_s = tau, .impulse_n_s = kUnitImpulse});
      const std::vector<double> pressure = play(body, 120, 17);
      const double begin = at / kRate - tau / 2;
      for (int n = 0; n < 120; ++n) {
        const double now = n / kRate;
        const double until = std::min(1.0, (now - begin) / tau);
        const double expected =
            until <= 0.0 ? 0.0
                         : testing::integrate(
                               [&](double x) {
                                 return testing::calc_reference_pulse(x) * calc_velocity(c.freq_hz, c.decay_per_s, now - begin - x * tau);
                               },
                               0.0, until);
        ASSERT_NEAR(pressure[n], expected, 1e-8) << c.freq_hz << " Hz, tau " << tau << ", sample " << n;
        if (until <= 0.0) {
          ASSERT_EQ(pressure[n], 0.0);
        }
      }
    }
  }
}

TEST(ReferenceBody, AnOverDampedModeFollowsAPulse) {
  // Roots d +- s by hand; the fast one spans from below to far above the sample rate.
  for (const double decay : {7000.0, 40000.0, 900000.0}) {
    const double freq = 1000.0, lambda = 4 * pi * pi * freq * freq;
    const double s = std::sqrt(decay * decay - lambda), fast = decay + s, slow = lambda / fast;
    const bank::Bank bank = make_cube_bank({{freq, decay}});
    ReferenceBody body(bank, kRate);
    ASSERT_EQ(body.get_mode_count(), 1);
    const double tau = 400e-6, at = 30.2;
    body.strike({.sample = at, .duration_s = tau, .impulse_n_s = kUnitImpulse});
    const std::vector<double> pressure = play(body, 80);
    const double begin = at / kRate - tau / 2;
    for (int n = 0; n < 80; ++n) {
      const double until = std::min(1.0, (n / kRate - begin) / tau);
      double expected = 0.0;
      // The fast root needs a fine grid: many short pieces.
      for (int piece = 0; piece < 200 && until > 0.0; ++piece) {
        expected += testing::integrate(
            [&](double x) {
              const double t = n / kRate - begin - x * tau;
              return testing::calc_reference_pulse(x) * (fast * std::exp(-fast * t) - slow * std::exp(-slow * t)) / (fast - slow);
            },
            until * piece / 200, until * (piece + 1) / 200);
      }
      ASSERT_NEAR(pressure[n], expected, 1e-8) << "decay " << decay << ", sample " << n;
    }
  }
}

TEST(ReferenceBody, AfterAPulseTheLevelIsThePulsesSpectrum) {
  for (const double tau : {10e-6, 70e-6, 300e-6, 1e-3}) {
    for (const double freq : {200.0, 1000.0, 4900.0, 19000.0}) {
      const bank::Bank bank = make_cube_bank({{freq, 0.0}});
      ReferenceBody body(bank, kRate);
      body.strike({.sample = 50.123, .duration_s = tau, .impulse_n_s = kUnitImpulse});
      play(body, 128);
      const double level = std::sqrt(2.0 * body.calc_energy_j());
      EXPECT_NEAR(level, std::abs(testing::calc_reference_spectrum(2 * pi * freq * tau)), 1e-8) << tau << " s, " << freq << " Hz";
    }
  }
  // Independent figures: a sin^1.5 pulse is 3 dB down at 0.66 / tau and 20 dB down at 1.48 / tau.
  EXPECT_NEAR(20 * std::log10(testing::calc_reference_spectrum(2 * pi * 0.66)), -3.0, 0.1);
  EXPECT_NEAR(20 * std::log10(testing::calc_reference_spectrum(2 * pi * 1.48)), -20.0, 0.3);
}

TEST(ReferenceBody, EnergyIsThatOfTheImpulseAndStaysWithoutDamping) {
  std::vector<InventedMode> modes = make_many_modes(21);
  for (auto& mode : modes) mode.decay_per_s = 0.0;
  const bank::Bank bank = make_cube_bank(modes);
  ReferenceBody body(bank, kRate);
  const Vec3 impulse{0.01, 0.02, -0.03};
  body.strike({.sample = 3.3, .triangle = 4, .barycentric = {0.2, 0.3, 0.5}, .impulse_n_s = impulse});
  play(body, 32);
  double expected = 0.0;
  for (std::size_t m = 0; m < bank.mode_count(); ++m) {
    double projection = 0.0;
    for (int corner = 0; corner < 3; ++corner) {
      const auto shape = bank.shape_at(bank.triangles[4][corner], m);
      projection += Vec3{0.2, 0.3, 0.5}[corner] * std::inner_product(shape.begin(), shape.end(), impulse.begin(), 0.0);
    }
    expected += 0.5 * projection * projection;
  }
  EXPECT_NEAR(body.calc_energy_j(), expected, 1e-10 * expected);
  play(body, 1'000'000, 4096);
  EXPECT_NEAR(body.calc_energy_j(), expected, 1e-9 * expected);
}

TEST(ReferenceBody, DampingOnlyTakesEnergyAway) {
  const bank::Bank bank = make_cube_bank({{50.0, 20.0}, {1000.0, 100.0}, {2000.0, 12566.4}, {3000.0, 40000.0}});
  ReferenceBody body(bank, kRate);
  body.strike({.sample = 1.5, .impulse_n_s = kUnitImpulse});
  play(body, 4, 1);
  double before = body.calc_energy_j();
  for (int n = 0; n < 2000; ++n) {
    play(body, 1);
    ASSERT_LE(body.calc_energy_j(), before * (1 + 1e-14));
    before = body.calc_energy_j();
  }
}

TEST(ReferenceBody, BlockSizeDoesNotChangeTheSound) {
  const bank::Bank bank = make_cube_bank(make_many_modes(37));
  std::vector<std::vector<double>> sounds;
  for (const std::size_t block : {1u, 64u, 511u}) {
    ReferenceBody body(bank, kRate);
    for (int i = 0; i < 20; ++i) {
      body.strike({.sample = 10.0 + 431.7 * i,
                   .duration_s = 20e-6 * (i + 1),
                   .triangle = i % 12,
                   .barycentric = {0.1, 0.2, 0.7},
                   .impulse_n_s = {0.1 * i, 0.0, 1.0}});
    }
    sounds.push_back(play(body, 20000, block));
  }
  const double peak = *std::max_element(sounds[0].begin(), sounds[0].end());
  ASSERT_GT(peak, 1e-3);
  for (std::size_t n = 0; n < sounds[0].size(); ++n) {
    ASSERT_NEAR(sounds[0][n], sounds[1][n], 1e-12 * peak);
    ASSERT_NEAR(sounds[0][n], sounds[2][n], 1e-12 * peak);
  }
}

TEST(ReferenceBody, ModesAtOrAboveNyquistAreNeverSounded) {
  const bank::Bank bank = make_cube_bank({{1000.0, 1.0}, {23999.0, 1.0}, {24000.0, 1.0}, {24001.0, 1.0}, {60000.0, 1.0}});
  EXPECT_EQ(ReferenceBody(bank, 48000.0).get_mode_count(), 2);
  EXPECT_EQ(ReferenceBody(bank, 44100.0).get_mode_count(), 1);
  EXPECT_EQ(ReferenceBody(bank, 192000.0).get_mode_count(), 5);
  // A damped frequency in range does not help: undamped 30 kHz, damped 10 kHz.
  const bank::Bank damped = make_cube_bank({{30000.0, 2 * pi * std::sqrt(8e8)}});
  EXPECT_EQ(ReferenceBody(damped, 48000.0).get_mode_count(), 0);
}

TEST(ReferenceBody, OppositeImpulsesCancelAndAZeroImpulseIsSilent) {
  const bank::Bank bank = make_cube_bank(make_many_modes(9));
  ReferenceBody plus(bank, kRate), minus(bank, kRate), zero(bank, kRate);
  plus.strike({.sample = 5.5, .duration_s = 1e-4, .impulse_n_s = {0.1, 0.2, 0.3}});
  minus.strike({.sample = 5.5, .duration_s = 1e-4, .impulse_n_s = {-0.1, -0.2, -0.3}});
  zero.strike({.sample = 5.5, .duration_s = 1e-4, .impulse_n_s = {0.0, 0.0, 0.0}});
  const auto a = play(plus, 500), b = play(minus, 500), c = play(zero, 500);
  for (int n = 0; n < 500; ++n) {
    ASSERT_EQ(a[n], -b[n]);
    ASSERT_EQ(c[n], 0.0);
  }
  EXPECT_TRUE(plus.is_awake());
  EXPECT_FALSE(zero.is_awake());
}

TEST(ReferenceBody, TheDirectionOfTheImpulseIsKept) {
  const bank::Bank bank = make_cube_bank({{1000.0, 1.0, 1.0, {1.0, 0.0, 0.0}}});
  ReferenceBody along(bank, kRate), across(bank, kRate), slanted(bank, kRate);
  along.strike({.sample = 0.0, .impulse_n_s = {1.0, 0.0, 0.0}});
  across.strike({.sample = 0.0, .impulse_n_s = {0.0, 1.0, 1.0}});
  slanted.strike({.sample = 0.0, .impulse_n_s = {0.6, 0.8, 0.0}});
  EXPECT_NEAR(play(along, 1)[0], 1.0, 1e-12);
  EXPECT_EQ(play(across, 1)[0], 0.0);
  EXPECT_NEAR(play(slanted, 1)[0], 0.6, 1e-12);
}

TEST(ReferenceBody, FallsAsleepAndWakesAgain) {
  const bank::Bank bank = make_cube_bank(make_many_modes(40));
  ReferenceBody body(bank, kRate);
  EXPECT_FALSE(body.is_awake());
  body.strike({.sample = 100.0, .impulse_n_s = kUnitImpulse});
  play(body, 1024);
  EXPECT_EQ(body.get_live_mode_count(), 40);
  play(body, 48000);
  const int later = body.get_live_mode_count();
  EXPECT_LT(later, 40);
  EXPECT_GT(later, 0);
  play(body, 48000 * 20);
  EXPECT_FALSE(body.is_awake());
  EXPECT_EQ(body.calc_energy_j(), 0.0);
  body.strike({.sample = body.get_position() + 0.5, .impulse_n_s = kUnitImpulse});
  EXPECT_NE(play(body, 10)[9], 0.0);
  EXPECT_TRUE(body.is_awake());
}

TEST(ReferenceBody, BadStrikesAreRefusedAndOverflowIsCleared) {
  const bank::Bank bank = make_cube_bank({{1000.0, 1.0}, {2000.0, 1.0, 1e300}});
  ReferenceBody body(bank, kRate, {.max_strikes = 4});
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(body.strike({.sample = nan}));
  EXPECT_FALSE(body.strike({.duration_s = -1.0}));
  EXPECT_FALSE(body.strike({.triangle = 12}));
  EXPECT_FALSE(body.strike({.triangle = -1}));
  EXPECT_FALSE(body.strike({.barycentric = {nan, 0.0, 0.0}}));
  EXPECT_FALSE(body.strike({.impulse_n_s = {0.0, std::numeric_limits<double>::infinity(), 0.0}}));
  EXPECT_EQ(body.get_counters().refused, 6);
  for (int i = 0; i < 4; ++i) EXPECT_TRUE(body.strike({.sample = 10.0, .impulse_n_s = {0.0, 0.0, 1e300}}));
  EXPECT_FALSE(body.strike({.sample = 10.0}));
  for (const double p : play(body, 200)) ASSERT_TRUE(std::isfinite(p));
  EXPECT_EQ(body.get_counters().resets, 1);
  EXPECT_TRUE(body.strike({.sample = 300.0, .impulse_n_s = {0.0, 0.0, 1e-300}}));
  EXPECT_NE(play(body, 200)[150], 0.0);
}

TEST(ReferenceBody, ALateStrikeSoundsAtOnceWithItsWholeImpulse) {
  const bank::Bank bank = make_cube_bank({{1000.0, 0.0}});
  ReferenceBody body(bank, kRate);
  play(body, 1000);
  body.strike({.sample = 200.0, .impulse_n_s = kUnitImpulse});
  EXPECT_EQ(body.get_counters().late, 1);
  play(body, 1);
  EXPECT_NEAR(body.calc_energy_j(), 0.5, 1e-9);
}

TEST(ReferenceBody, ABankWithArraysThatDisagreeIsRefused) {
  bank::Bank bank = make_cube_bank({{1000.0, 1.0}});
  bank.shape.pop_back();
  EXPECT_THROW(ReferenceBody(bank, kRate), InputError);
  bank = make_cube_bank({{1000.0, 1.0}});
  bank.triangles[3][1] = 8;
  EXPECT_THROW(ReferenceBody(bank, kRate), InputError);
  bank = make_cube_bank({{1000.0, 1.0}});
  EXPECT_THROW(ReferenceBody(bank, 0.0), InputError);
}

}  // namespace
}  // namespace carillon::synth
