// Radiated energy through a sphere of 1 m against the energy of the modes.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <vector>

#include "runtime/acoustics/radiation/gains.hpp"
#include "runtime/base/error.hpp"
#include "runtime/synth/resonator_bank.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::radiation {
namespace {

using std::numbers::pi;

constexpr double kRate = 48000.0;
constexpr double kAirKgM2S = 1.21 * 343.0;

/// Energy [J] through a sphere of 1 m after a strike of 1 N s at time 0. Each mode has 1/2 J.
double calc_radiated(const bank::Bank& bank, double length_s) {
  synth::ResonatorBank voice(synth::Model::make(bank, {.rate_hz = kRate}));
  voice.strike({.time_s = 0.5 / kRate, .triangle = 0, .barycentric = {1, 0, 0}, .impulse_n_s = {0, 0, 1}});
  std::vector<float> pressure(length_s * kRate, 0.0F);
  voice.process(pressure);
  double square = 0.0;
  for (const float p : pressure) square += static_cast<double>(p) * p;
  return 4.0 * pi * square / kRate / kAirKgM2S;
}

TEST(LimitGains, AFreeDecayRadiatesItsShareAndNeverMoreThanTheModeHad) {
  for (const double decay : {1.0, 8.0, 60.0}) {
    const double allowed = std::sqrt(kAirKgM2S * decay / (2.0 * pi));
    for (const double times : {0.01, 0.5, 0.999, 1.001, 3.0, 1000.0}) {
      bank::Bank bank = testing::make_cube_bank({{900.0, decay, times * allowed}});
      const double given = bank.radiation_gain[0];
      const Limited limited = limit_gains(bank.radiation_gain, bank.decay_per_s);
      if (times < 1.0) {
        EXPECT_EQ(bank.radiation_gain[0], given);
        EXPECT_EQ(limited.modes, 0U);
        EXPECT_EQ(limited.max_db, 0.0);
      } else {
        EXPECT_EQ(limited.modes, 1U);
        EXPECT_NEAR(limited.max_db, 20.0 * std::log10(times), 1e-9);
      }
      const double share = std::min(1.0, times * times);
      EXPECT_NEAR(calc_radiated(bank, 7.0 / decay), 0.5 * share, 2e-3 * 0.5 * share) << decay << " " << times;
    }
  }
}

TEST(LimitGains, ManyModesRadiateNoMoreThanTheyHad) {
  std::vector<testing::InventedMode> modes;
  for (int m = 0; m < 40; ++m) modes.push_back({150.0 * std::pow(1.12, m), 0.5 + 0.3 * m, 0.02 * std::pow(1.4, m)});
  bank::Bank bank = testing::make_cube_bank(modes);
  EXPECT_GT(calc_radiated(bank, 8.0), 0.5 * 40);
  double expected = 0.0;
  const Limited limited = limit_gains(bank.radiation_gain, bank.decay_per_s);
  for (const auto& mode : modes) expected += 0.5 * std::min(1.0, 2.0 * pi * mode.gain * mode.gain / (kAirKgM2S * mode.decay_per_s));
  EXPECT_GT(limited.modes, 5U);
  EXPECT_LT(limited.modes, 35U);
  // Modes of different frequencies share no energy but for the first moments, before they have left each other's phase.
  EXPECT_NEAR(calc_radiated(bank, 8.0), expected, 0.02 * expected);
}

TEST(LimitGains, WithoutDampingAModeKeepsItsGainAndRingsForEver) {
  bank::Bank bank = testing::make_cube_bank({{500.0, 0.0, 3.0}});
  EXPECT_EQ(limit_gains(bank.radiation_gain, bank.decay_per_s).modes, 0U);
  EXPECT_EQ(bank.radiation_gain[0], 3.0);
  std::vector<double> gains(2, 1.0);
  EXPECT_THROW(limit_gains(gains, bank.decay_per_s), InputError);
}

}  // namespace
}  // namespace carillon::radiation
