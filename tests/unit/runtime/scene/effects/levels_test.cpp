#include "runtime/scene/effects/levels.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>

#include "runtime/synth/acceleration_noise.hpp"
#include "tests/unit/runtime/synth/cube_bank.hpp"

namespace carillon::effects {
namespace {

using std::numbers::pi;

double to_db(double factor) { return 20.0 * std::log10(factor); }

TEST(Levels, AWeightingIsThatOfTheStandard) {
  // IEC 61672-1:2013, table 3, exact mid-band frequencies.
  const std::array<std::array<double, 2>, 8> table{
      {{31.623, -39.4}, {100.0, -19.1}, {251.19, -8.6}, {501.19, -3.2}, {1000.0, 0.0}, {3162.3, 1.2}, {10000.0, -2.5}, {19953.0, -9.3}}};
  for (const auto& [freq, db] : table) EXPECT_NEAR(to_db(calc_a_weight(freq)), db, 0.06) << freq;
  EXPECT_EQ(calc_a_weight(0.0), 0.0);
}

TEST(Levels, SpectrumOfThePulseAgreesWithQuadrature) {
  for (const double cycles : {0.01, 0.0871, 0.4, 0.66, 1.0, 1.48, 2.75, 4.1, 9.3, 40.2}) {
    std::complex<double> sum = 0.0;
    double area = 0.0;
    constexpr int kSteps = 200000;  // in theta, x = (1 - cos theta) / 2, which makes the ends smooth
    for (int i = 0; i < kSteps; ++i) {
      const double theta = pi * (i + 0.5) / kSteps, x = 0.5 * (1.0 - std::cos(theta));
      const double force = std::pow(std::sin(pi * x), 1.5) * std::sin(theta);
      area += force;
      sum += force * std::polar(1.0, 2.0 * pi * cycles * x);
    }
    const double wanted = std::abs(sum) / area;
    EXPECT_NEAR(calc_pulse_spectrum(events::PulseShape::kHertz, cycles), wanted, 1e-4 * wanted + 2e-6) << cycles;
  }
  EXPECT_EQ(calc_pulse_spectrum(events::PulseShape::kHertz, 0.0), 1.0);
  EXPECT_GT(calc_pulse_spectrum(events::PulseShape::kHertz, 70.3), 0.0);
  // The Gaussian has the same variance: the same curvature at 0.
  const double hertz = 1.0 - calc_pulse_spectrum(events::PulseShape::kHertz, 0.05);
  EXPECT_NEAR(1.0 - calc_pulse_spectrum(events::PulseShape::kGaussian, 0.05), hertz, 0.01 * hertz);
}

TEST(Levels, ExposureOfAModeIsTheIntegralOfItsSquare) {
  const bank::Bank bank = testing::make_cube_bank({{1000.0, 30.0, 0.02}});
  const BankLevels levels(bank, 48000.0);
  ASSERT_EQ(levels.get_modes().size(), 1u);
  std::vector<double> projections, amplitude;
  ASSERT_TRUE(levels.calc_projections(3, {0.2, 0.3, 0.5}, {0.4, 0.0, 0.5}, projections));
  EXPECT_NEAR(projections[0], 0.5, 1e-4);
  const StrikeLevels strike = calc_strike_levels(levels, projections, events::PulseShape::kHertz, 0.0, amplitude);
  double sum = 0.0;
  for (int n = 0; n < 480000; ++n) {
    const double t = (n + 0.5) / 480000.0, p = 0.02 * 0.5 * std::exp(-30.0 * t) * std::cos(2.0 * pi * 1000.0 * t);
    sum += p * p / 480000.0;
  }
  EXPECT_NEAR(strike.modal_pa2_s, sum, 2e-3 * sum);
  EXPECT_NEAR(strike.mean_hz, 1000.0, 1e-6);
  EXPECT_NEAR(amplitude[0], 0.01, 1e-5);
  EXPECT_EQ(strike.pulse_loss_pa2_s, 0.0);
  // 1 Pa^2 s within 0.2 s is 5 Pa^2: 101 dB.
  EXPECT_NEAR(calc_level_db(1.0), 10.0 * std::log10(5.0 / 4e-10), 1e-9);
  EXPECT_FALSE(levels.calc_projections(12, {1, 0, 0}, {0, 0, 1}, projections));
}

TEST(Levels, UltrasonicModesFollowAPush) {
  // One mode at 22 kHz, strongly damped, under a pulse of 0.4 ms, at 384 kHz by its equation of motion; its Fourier transform up to 15.4
  // kHz.
  const bank::Bank bank = testing::make_cube_bank({{22000.0, 4000.0, 0.03}});
  const BankLevels levels(bank, 48000.0);
  EXPECT_TRUE(levels.get_modes().empty());
  constexpr double kRate = 384000.0, kLength = 4e-4;
  const double lambda = std::pow(2.0 * pi * 22000.0, 2.0), norm = std::sqrt(pi) * std::tgamma(1.75) / std::tgamma(1.25) / kLength;
  double q = 0.0, v = 0.0;
  std::vector<double> sound;
  for (int n = 0; n < 1024; ++n) {
    for (int part = 0; part < 64; ++part) {  // symplectic Euler, 64 steps a sample
      const double h = 1.0 / (64.0 * kRate), t = (n * 64 + part) * h,
                   force = t < kLength ? norm * std::pow(std::sin(pi * t / kLength), 1.5) : 0.0;
      v += h * (0.002 * force - 2.0 * 4000.0 * v - lambda * q);
      q += h * v;
    }
    sound.push_back(0.03 * v);
  }
  double sum = 0.0;
  constexpr int kBands = 300;
  const double step = std::log(15400.0 / 20.0) / kBands;
  for (int band = 0; band < kBands; ++band) {
    const double freq = 20.0 * std::exp(step * (band + 0.5));
    std::complex<double> p = 0.0;
    for (std::size_t n = 0; n < sound.size(); ++n)
      p += sound[n] * std::polar(1.0 / kRate, -2.0 * pi * freq * static_cast<double>(n) / kRate);
    sum += 2.0 * std::norm(p) * std::pow(calc_a_weight(freq), 2.0) * freq * step;
  }
  // Nearly all of a pulse of 0.4 ms is far below the mode, where it follows the force; towards it the mode moves more.
  const double pushed = levels.calc_pushed_pa2_s(3, {0.2, 0.3, 0.5}, {0, 0, 0.002}, events::PulseShape::kHertz, kLength);
  EXPECT_NEAR(pushed, sum, 0.1 * sum);
}

TEST(Levels, OnlyAudibleModesCount) {
  const bank::Bank bank = testing::make_cube_bank({{12.0, 1.0}, {500.0, 5.0}, {11000.0, 5.0}, {21000.0, 5.0}});
  EXPECT_EQ(BankLevels(bank, 48000.0).get_modes().size(), 2u);
  EXPECT_EQ(BankLevels(bank, 16000.0).get_modes().size(), 1u);
  EXPECT_EQ(BankLevels(bank, 96000.0).get_modes().size(), 2u);
}

TEST(Levels, ExposureOfAClickIsThatOfTheSoundOfASphere) {
  const bank::Bank bank = testing::make_cube_bank({{500.0, 5.0}}, 700.0);
  const BankLevels levels(bank, 48000.0);
  EXPECT_NEAR(levels.get_radius_m(), std::cbrt(0.75 * 1e-3 / pi), 1e-9);
  for (const double duration : {1e-4, 1.2e-3}) {
    // The sound itself at 192 kHz, its Fourier transform at a few hundred frequencies, A-weighted.
    constexpr double kRate = 192000.0;
    synth::AccelerationNoise click(levels.get_radius_m(), bank.rigid.mass_kg, kRate);
    click.strike({.time_s = 5e-3, .impulse_n_s = {0, 0, 0.3}, .duration_s = duration}, {1, 0, 0, 0});
    std::array<std::vector<float>, 3> sound;
    for (auto& axis : sound) axis.resize(8192);
    click.process({sound[0], sound[1], sound[2]});
    double sum = 0.0;
    constexpr int kBands = 300;
    const double step = std::log(1000.0) / kBands;
    for (int band = 0; band < kBands; ++band) {
      const double freq = 20.0 * std::exp(step * (band + 0.5));
      std::complex<double> p = 0.0;
      for (std::size_t n = 0; n < sound[2].size(); ++n) {
        p += static_cast<double>(sound[2][n]) * std::polar(1.0 / kRate, -2.0 * pi * freq * static_cast<double>(n) / kRate);
      }
      sum += 2.0 * std::norm(p) * std::pow(calc_a_weight(freq), 2.0) * freq * step;
    }
    const ClickLevels wanted = levels.calc_click_levels(0.3, events::PulseShape::kHertz, duration);
    EXPECT_NEAR(wanted.pa2_s, sum, 0.01 * sum) << duration;
  }
}

}  // namespace
}  // namespace carillon::effects
