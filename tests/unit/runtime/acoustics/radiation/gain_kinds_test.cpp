// Choice of gains for playback.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "runtime/acoustics/radiation/gains.hpp"
#include "runtime/bank/corrected.hpp"
#include "runtime/base/error.hpp"
#include "tests/unit/runtime/acoustics/radiation/multipole_bank.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::radiation {
namespace {

/// Cube of two modes in air: radiation adds 1 and 200 per second to their decays.
bank::Bank make_cube_in_air() {
  bank::Bank bank = testing::make_cube_bank({{500.0, 3.0, 2.0}, {900.0, 5.0, 3.0}});
  const bank::Multipoles sphere = testing::make_empty_multipoles().multipoles;
  bank.multipoles = sphere;
  bank.multipoles.freq_hz = {500.0, 900.0};
  bank.multipoles.order = {0, 0};
  bank.multipoles.scale = {1e-3, 1e-3};
  bank.multipoles.coefficient = {32767, 0, 0, 32767};
  bank.multipoles.decay_per_s = {1.0, 200.0};
  bank.multipoles.added_mass = {0.0, 0.0};
  bank.multipoles.error_db = {-60.0, -60.0};
  return bank;
}

/// g^2 = rho0 c0 d / 2 pi.
double calc_gain(double decay_per_s) { return std::sqrt(1.21 * 343.0 * decay_per_s / (2.0 * std::numbers::pi)); }

TEST(GainKinds, ABankWithMultipolesIsPlayedWithThem) {
  const bank::Bank plain = testing::make_cube_bank({{500.0, 1.0}}), air = make_cube_in_air();
  EXPECT_EQ(choose_gain_kind(plain, GainKind::kAuto), GainKind::kSphere);
  EXPECT_EQ(choose_gain_kind(air, GainKind::kAuto), GainKind::kBem);
  for (const GainKind wish : {GainKind::kOsg02, GainKind::kSphere, GainKind::kVddp96, GainKind::kBem}) {
    EXPECT_EQ(choose_gain_kind(air, wish), wish);
    EXPECT_EQ(choose_gain_kind(plain, wish), wish);
  }
  EXPECT_EQ(calc_gains(air, GainKind::kAuto), calc_gains(air, GainKind::kBem));
  EXPECT_EQ(calc_radiation(air, GainKind::kAuto).gains, calc_gains(air, GainKind::kBem));
  EXPECT_EQ(calc_gains(plain, GainKind::kAuto), calc_gains(plain, GainKind::kSphere));
  EXPECT_NE(calc_gains(air, GainKind::kSphere), calc_gains(air, GainKind::kBem));
}

TEST(GainKinds, TheGainsOfMultipolesAreThoseOfTheirDecaysAndHaveNoLimit) {
  bank::Bank bank = bank::choose_frequencies(make_cube_in_air(), bank::Frequencies::kMesh);
  const std::vector<double> decays = bank.decay_per_s;
  EXPECT_NEAR(decays[0], 4.0, 1e-12);
  EXPECT_NEAR(decays[1], 205.0, 1e-12);
  const PutGains put = put_gains(bank, GainKind::kAuto);
  EXPECT_EQ(put.limited.modes, 0U);
  EXPECT_GT(put.sphere_radius_m, 0.0);
  EXPECT_NEAR(bank.radiation_gain[0], calc_gain(1.0), 1e-9);
  EXPECT_NEAR(bank.radiation_gain[1], calc_gain(200.0), 1e-9);
  EXPECT_EQ(bank.decay_per_s, decays);
  // Even where a support gives a mode less damping than the air takes.
  bank.decay_per_s = {0.5, 0.5};
  EXPECT_EQ(put_gains(bank, GainKind::kBem).limited.modes, 0U);
  EXPECT_NEAR(bank.radiation_gain[1], calc_gain(200.0), 1e-9);
}

TEST(GainKinds, TheSphereOfABankWithMultipolesKeepsTheirDecays) {
  bank::Bank bank = bank::choose_frequencies(make_cube_in_air(), bank::Frequencies::kMesh);
  const std::vector<double> decays = bank.decay_per_s;
  std::vector<double> gains = calc_gains(bank, GainKind::kSphere);
  for (std::size_t m = 0; m < gains.size(); ++m) gains[m] = std::min(gains[m], calc_gain(decays[m]));
  (void)put_gains(bank, GainKind::kSphere);
  for (std::size_t m = 0; m < gains.size(); ++m) EXPECT_NEAR(bank.radiation_gain[m], gains[m], 1e-12);
  EXPECT_EQ(bank.decay_per_s, decays);
}

TEST(GainKinds, BanksWithoutMultipolesHaveNoSuchGains) {
  bank::Bank bank = testing::make_cube_bank({{500.0, 1.0}});
  try {
    (void)put_gains(bank, GainKind::kBem);
    FAIL() << "no error";
  } catch (const InputError& error) {
    EXPECT_NE(std::string(error.what()).find("no multipoles"), std::string::npos) << error.what();
  }
  bank = make_cube_in_air();
  bank.multipoles.decay_per_s.pop_back();
  EXPECT_THROW(calc_gains(bank, GainKind::kBem), InputError);
}

TEST(GainKinds, NamesAreThoseOfTheKinds) {
  EXPECT_EQ(require_gain_kind("radiation", "bem"), GainKind::kBem);
  EXPECT_EQ(require_gain_kind("radiation", "auto"), GainKind::kAuto);
  EXPECT_EQ(require_gain_kind("radiation", "osg02"), GainKind::kOsg02);
  EXPECT_THROW(require_gain_kind("radiation", "loud"), InputError);
}

}  // namespace
}  // namespace carillon::radiation
