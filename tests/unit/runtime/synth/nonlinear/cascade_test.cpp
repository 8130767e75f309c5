// Cascade: energy balance, extreme strikes, soft strikes, determinism.
#include "runtime/synth/nonlinear/cascade.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <random>

#include "runtime/base/error.hpp"
#include "tests/unit/runtime/synth/nonlinear/bodies.hpp"

namespace carillon::nonlinear {
namespace {

constexpr double kRate = 48000.0;
constexpr std::size_t kLow = 20, kHigh = 100;
constexpr CascadeBody kSheet{.mass_kg = 0.4 * 0.3 * 1e-3 * 7850.0, .thickness_m = 1e-3};

double keep_all(double) { return 0.0; }
double lose(double omega) { return 1.0 + 1e-9 * omega * omega; }

/// Plate with its lowest modes coupled.
struct Sheet {
  explicit Sheet(double (*decay)(double), CoupledOptions options = {})
      : body(bodies::Plate{}.make(kLow, decay)),
        above(make_above(decay)),
        coupled(body.energy, body.modes, kRate, options),
        cascade(body.modes, above, kSheet, kRate),
        push(kLow + kHigh),
        none(kLow + kHigh, 0.0) {
    std::mt19937 chance(3);
    for (double& x : push) x = std::uniform_real_distribution<double>(-1.0, 1.0)(chance) / std::sqrt(kSheet.mass_kg);
  }
  static std::vector<ModeConstants> make_above(double (*decay)(double)) {
    std::vector<ModeConstants> modes;
    const auto all = bodies::Plate{}.find_modes(kLow + kHigh);
    for (std::size_t m = kLow; m < all.size(); ++m) modes.push_back({all[m].omega * all[m].omega, decay(all[m].omega)});
    return modes;
  }
  /// Returns the energy that the modes above got.
  double strike(double impulse_n_s, double share_above = 1.0) {
    std::vector<double> re = push;
    for (std::size_t i = 0; i < re.size(); ++i) re[i] *= 2.0 * impulse_n_s * (i < kLow ? 1.0 : share_above);
    const std::span<const double> r(re), z(none);
    coupled.step(r.first(kLow), z.first(kLow));
    const double before = cascade.calc_energy_j() - cascade.get_book().gained_j + cascade.get_book().lost_j;
    cascade.step(coupled, r.subspan(kLow), z.subspan(kLow), {});
    return cascade.calc_energy_j() - cascade.get_book().gained_j + cascade.get_book().lost_j - before;
  }
  void step() {
    coupled.step();
    cascade.step(coupled, {}, {}, {});
  }
  double calc_energy_j() const { return coupled.get_energy_j() + cascade.calc_energy_j() + cascade.get_book().lost_j; }

  bodies::Body body;
  std::vector<ModeConstants> above;
  CoupledModes coupled;
  Cascade cascade;
  std::vector<double> push, none;
};

TEST(Cascade, ModesAboveGainTheLossOfTheCoupledModes) {
  Sheet sheet(keep_all, {.integrator = Integrator::kAuxiliary, .relaxation_s = 0.0});
  const double given = sheet.strike(1.0, 0.1);
  const double before = sheet.coupled.get_work_j() + given;
  for (int n = 0; n < 48000; ++n) sheet.step();
  const CascadeBook& book = sheet.cascade.get_book();
  EXPECT_GT(book.taken_j, 0.02 * before);  // and something happens
  EXPECT_EQ(book.taken_j, book.gained_j);
  EXPECT_NEAR(sheet.cascade.calc_energy_j() + book.lost_j, given + book.gained_j, 1e-11 * before);
  EXPECT_NEAR(sheet.coupled.get_energy_j(), sheet.coupled.get_work_j() - book.taken_j, 1e-10 * before);
  EXPECT_NEAR(sheet.calc_energy_j(), before, 1e-10 * before);
}

TEST(Cascade, ModesAtRestAreFilledFromBelow) {
  Sheet sheet(lose);
  sheet.strike(2.0, 0.0);
  EXPECT_EQ(sheet.cascade.calc_energy_j(), 0.0);
  for (int n = 0; n < 24000; ++n) sheet.step();
  EXPECT_GT(sheet.cascade.calc_energy_j(), 1e-3 * sheet.coupled.get_work_j());
  for (int i = 0; i < sheet.cascade.get_count(); ++i) EXPECT_NE(sheet.cascade.get_velocity(i), 0.0) << i;
}

TEST(Cascade, ExtremeStrikesGiveNoMoreThanTheirWork) {
  for (const double impulse : {1.0, 1e2, 1e4})
    for (auto* decay : {keep_all, lose}) {
      Sheet sheet(decay);
      double given = 0.0, most = 0.0;
      for (int blow = 0; blow < 3; ++blow) {
        given += sheet.strike(impulse);
        for (int n = 0; n < 3000; ++n) {
          sheet.step();
          const double energy = sheet.coupled.get_energy_j() + sheet.cascade.calc_energy_j();
          ASSERT_TRUE(std::isfinite(energy)) << impulse;
          most = std::max(most, energy / (sheet.coupled.get_work_j() + given));
        }
      }
      EXPECT_LE(most, 1.03) << impulse;
    }
}

TEST(Cascade, SoftBlowsLeaveTheLinearModes) {
  Sheet sheet(lose);
  sheet.strike(1e-5);
  for (int n = 0; n < 24000; ++n) sheet.step();
  EXPECT_EQ(sheet.cascade.get_book().taken_j, 0.0);
  double error = 0.0, sound = 0.0;
  for (std::size_t m = 0; m < kHigh; ++m) {  // the closed form
    const double d = sheet.above[m].decay_per_s, omega = std::sqrt(sheet.above[m].eigenvalue_rad2_s2);
    const double damped = std::sqrt((omega - d) * (omega + d)), t = 24000.0 / kRate;
    const double wanted = 2e-5 * sheet.push[kLow + m] * std::exp(-d * t) * (std::cos(damped * t) - d / damped * std::sin(damped * t));
    error += std::pow(sheet.cascade.get_velocity(static_cast<int>(m)) - wanted, 2);
    sound += wanted * wanted;
  }
  EXPECT_LE(10.0 * std::log10(error / sound), -100.0);
}

TEST(Cascade, ATensionRaisesAllModesByTheSame) {
  // One coupled mode of q'' + lambda q + b q^3: tau = b q^2 / omega, mean over a period b a^2 / 2 omega, of which half is heard.
  const double amplitude = 1e-3, lambda = bodies::to_eigenvalue(2000.0), b = 0.02 * lambda / (amplitude * amplitude);
  const bodies::Body low = bodies::make_duffing(2000.0, b);
  const std::vector<ModeConstants> above{{bodies::to_eigenvalue(4000.0), 0.0}, {bodies::to_eigenvalue(7000.0), 0.0}};
  CoupledModes coupled(low.energy, low.modes, kRate);
  Cascade cascade(low.modes, above, {.mass_kg = 1e6, .thickness_m = 1.0}, kRate);
  coupled.set_state(0, amplitude, 0.0);
  cascade.set_state(0, 0.0, 1e-9);
  cascade.set_state(1, 0.0, 1e-9);
  double turned[2] = {}, last[2] = {};
  const int samples = 24000;
  for (int n = 0; n < samples; ++n) {
    coupled.step();
    cascade.step(coupled, {}, {}, {});
    for (int i = 0; i < 2; ++i) {
      const double angle = std::atan2(cascade.get_im(i), cascade.get_re(i));
      turned[i] += std::remainder(angle - last[i], 2.0 * bodies::kPi);
      last[i] = angle;
    }
  }
  EXPECT_EQ(cascade.get_book().taken_j, 0.0);
  const double wanted_hz = 0.5 * b * amplitude * amplitude / (2.0 * std::sqrt(lambda)) / (2.0 * bodies::kPi);
  EXPECT_GT(wanted_hz, 5.0);
  for (int i = 0; i < 2; ++i) {
    const double found_hz = turned[i] / (2.0 * bodies::kPi) * kRate / samples - (i == 0 ? 4000.0 : 7000.0);
    EXPECT_NEAR(found_hz, wanted_hz, 0.03 * wanted_hz) << i;
  }
  EXPECT_NEAR(cascade.calc_energy_j(), 1e-18, 1e-28);
}

TEST(Cascade, TheSameStepsGiveTheSameBits) {
  Sheet one(lose), other(lose);
  other.strike(3.0);
  for (int n = 0; n < 1000; ++n) other.step();
  other.coupled.reset();
  other.cascade.reset();
  for (Sheet* sheet : {&one, &other}) {
    sheet->strike(2.0);
    for (int n = 0; n < 5000; ++n) sheet->step();
  }
  EXPECT_GT(one.cascade.get_book().taken_j, 0.0);
  EXPECT_TRUE(std::ranges::equal(one.cascade.get_velocities(), other.cascade.get_velocities()));
}

TEST(Cascade, AnotherLimitMakesNoStep) {
  Sheet sheet(lose);
  sheet.strike(2.0);
  double before = 0.0, largest = 0.0, at_change = 0.0;
  for (int n = 0; n < 4000; ++n) {
    if (n == 2000) sheet.coupled.set_limit(6);
    if (n == 3000) sheet.coupled.set_limit(0);
    sheet.step();
    double sum = 0.0;
    for (const double v : sheet.cascade.get_velocities()) sum += v;
    for (int i = 0; i < sheet.coupled.get_count(); ++i) sum += sheet.coupled.get_velocity(i);
    if (n > 1000 && n < 2000) largest = std::max(largest, std::abs(sum - before));
    if (n == 2000 || n == 3000) at_change = std::max(at_change, std::abs(sum - before));
    before = sum;
  }
  EXPECT_LE(at_change, largest);
}

TEST(Cascade, RefusesUnplayableModes) {
  const bodies::Body body = bodies::Plate{}.make(4, lose);
  const std::vector<ModeConstants> above{{bodies::to_eigenvalue(4000.0), 1.0}}, fast{{bodies::to_eigenvalue(25000.0), 1.0}};
  EXPECT_THROW(Cascade(body.modes, {}, kSheet, kRate), InputError);
  EXPECT_THROW(Cascade(body.modes, fast, kSheet, kRate), InputError);
  EXPECT_THROW(Cascade(body.modes, above, {.mass_kg = 1.0, .thickness_m = 0.0}, kRate), InputError);
  EXPECT_THROW(Cascade(body.modes, above, {.mass_kg = std::numeric_limits<double>::quiet_NaN(), .thickness_m = 1e-3}, kRate), InputError);
  EXPECT_THROW(Cascade(body.modes, above, kSheet, 0.0), InputError);
}

}  // namespace
}  // namespace carillon::nonlinear
