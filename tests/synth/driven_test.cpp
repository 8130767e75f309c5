// The driven bank against the closed form of a step of force, and against steps laid one over another.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "runtime/synth/driven_bank.hpp"
#include "tests/synth/cube_bank.hpp"

namespace carillon::synth {
namespace {

using std::numbers::pi;
constexpr double kRate = 48000.0;

struct Mode {
  double freq_hz, decay_per_s, gain;
};

/// Pressure at sample n after a force of 1 N that began at the instant of sample -1: g q' of q'' + 2 d q' + lambda q = 1.
double calc_step(const std::vector<Mode>& modes, int n) {
  double sum = 0.0;
  for (const Mode& mode : modes) {
    const double omega = 2.0 * pi * mode.freq_hz, omega_d = std::sqrt(omega * omega - mode.decay_per_s * mode.decay_per_s),
                 t = (n + 1) / kRate;
    if (n >= 0) sum += mode.gain / omega_d * std::exp(-mode.decay_per_s * t) * std::sin(omega_d * t);
  }
  return sum;
}

std::shared_ptr<const Model> make_model(const std::vector<Mode>& modes) {
  std::vector<testing::InventedMode> invented;
  for (const Mode& mode : modes) invented.push_back({mode.freq_hz, mode.decay_per_s, mode.gain});
  return Model::make(testing::make_cube_bank(invented), {.rate_hz = kRate});
}

std::vector<Mode> make_modes(int count) {
  std::vector<Mode> modes;
  for (int m = 0; m < count; ++m) {
    const double freq = 60.0 * std::pow(390.0, (m + 0.5) / count);
    modes.push_back({freq, 1.0 + 1e-6 * freq * freq, 1.0 + 1e-3 * freq});
  }
  return modes;
}

TEST(DrivenBank, AStepOfForceSoundsLikeTheClosedFormForEveryCountOfModesAndInstructions) {
  for (const Isa isa : {Isa::kPlain, Isa::kSse2, Isa::kAvx2, Isa::kAvx512}) {
    for (const int count : {1, 7, 16, 17, 40, 130, 301}) {
      const std::vector<Mode> modes = make_modes(count);
      DrivenBank bank(*make_model(modes), 3, {0.2, 0.3, 0.5}, {0.0, 0.0, 1.0}, isa);
      const std::vector<float> force(4800, 1.0F);
      std::vector<float> pressure(4800, 0.0F);
      bank.process(force, pressure);
      double error = 0.0, size = 0.0;
      for (int n = 0; n < 4800; ++n) {
        const double expected = calc_step(modes, n);
        error += std::pow(pressure[static_cast<std::size_t>(n)] - expected, 2), size += expected * expected;
      }
      // A hundredth of a cent leaves this much phase after 120 periods.
      EXPECT_LT(10 * std::log10(error / size), -70.0) << get_name(isa) << ", " << count << " modes";
    }
  }
}

TEST(DrivenBank, AnyForceIsASumOfSteps) {
  const std::vector<Mode> modes = make_modes(60);
  DrivenBank bank(*make_model(modes), 0, {1.0, 0.0, 0.0}, {0.0, 0.0, 1.0});
  std::mt19937 random(5);
  std::uniform_real_distribution<float> number(-1.0F, 1.0F);
  std::vector<float> force(700), pressure(700, 0.0F);
  for (float& x : force) x = number(random);
  for (std::size_t n = 0; n < 700;) {  // in blocks of any size
    const std::size_t size = std::min<std::size_t>(1 + random() % 90, 700 - n);
    bank.process(std::span(force).subspan(n, size), std::span(pressure).subspan(n, size));
    n += size;
  }
  double error = 0.0, all = 0.0;
  for (int n = 0; n < 700; ++n) {
    double expected = 0.0;
    for (int k = 0; k <= n; ++k) {
      const double step = force[static_cast<std::size_t>(k)] - (k > 0 ? force[static_cast<std::size_t>(k - 1)] : 0.0);
      expected += step * calc_step(modes, n - k);
    }
    error += std::pow(pressure[static_cast<std::size_t>(n)] - expected, 2), all += expected * expected;
  }
  EXPECT_LT(10 * std::log10(error / all), -80.0);
}

std::vector<float> make_noise(std::size_t count) {
  std::mt19937 random(6);
  std::uniform_real_distribution<float> number(-1.0F, 1.0F);
  std::vector<float> force(count);
  for (float& x : force) x = number(random);
  return force;
}

/// The error of a bank under noise, relative to the sum of steps in double precision [dB]; calls of any size.
double calc_error_db(const std::vector<Mode>& modes, Isa isa, float load_n = 0.0F) {
  constexpr std::size_t kCount = 1500;
  std::vector<float> force = make_noise(kCount);
  for (float& x : force) x += load_n;
  DrivenBank bank(*make_model(modes), 0, {1.0, 0.0, 0.0}, {0.0, 0.0, 1.0}, isa);
  if (load_n != 0.0F) {  // until its onset has died away
    std::vector<float> unheard(48000);
    bank.process(std::vector<float>(48000, load_n), unheard);
  }
  std::vector<float> pressure(kCount, 0.0F);
  std::mt19937 random(7);
  for (std::size_t n = 0; n < kCount;) {
    const std::size_t size = std::min<std::size_t>(1 + random() % 300, kCount - n);
    bank.process(std::span(force).subspan(n, size), std::span(pressure).subspan(n, size));
    n += size;
  }
  std::vector<double> step;
  for (int n = 0; n < static_cast<int>(kCount); ++n) step.push_back(calc_step(modes, n));
  double error = 0.0, all = 0.0;
  for (std::size_t n = 0; n < kCount; ++n) {
    double expected = 0.0;
    for (std::size_t k = 0; k <= n; ++k) expected += (double{force[k]} - double{k > 0 ? force[k - 1] : load_n}) * step[n - k];
    error += std::pow(pressure[n] - expected, 2), all += expected * expected;
  }
  return 10 * std::log10(error / all);
}

TEST(DrivenBank, IsExactTo120DecibelsForEveryDampingAndInstructions) {
  std::vector<Mode> all;
  std::mt19937 random(8);
  std::uniform_real_distribution<double> number(0.0, 1.0);
  for (const double decay : {0.0, 30.0, 250.0, 400.0, 1000.0, 3000.0, 6000.0, 9000.0, 30000.0, 90000.0}) {
    std::vector<Mode> modes;
    for (int m = 0; m < 50; ++m) {
      const double lowest = std::max(20.0, 1.1 * decay / (2.0 * pi)), freq = lowest * std::pow(23900.0 / lowest, number(random));
      // As loud as each other.
      modes.push_back({freq, decay * (0.9 + 0.1 * number(random)), std::sqrt(1.0 + decay) * freq});
    }
    for (const Isa isa : {Isa::kPlain, Isa::kSse2, Isa::kAvx2, Isa::kAvx512}) {
      EXPECT_LT(calc_error_db(modes, isa), -120.0) << decay << " per second, " << get_name(isa);
    }
    all.insert(all.end(), modes.begin(), modes.end());
  }
  EXPECT_LT(calc_error_db(all, Isa::kBest), -120.0);
}

TEST(DrivenBank, FewModesOrManyNearEitherEndOfTheBandAreExact) {
  for (const int count : {1, 15, 16, 17, 33, 63, 64, 65, 79, 81, 130}) {
    for (const double lowest : {2.0, 1000.0, 22900.0}) {
      std::vector<Mode> modes;
      for (int m = 0; m < count; ++m) modes.push_back({lowest + 1000.0 * m / count, 10.0, lowest + 1000.0 * m / count});
      EXPECT_LT(calc_error_db(modes, Isa::kBest), -120.0) << count << " modes from " << lowest << " Hz";
    }
  }
}

TEST(DrivenBank, AStaticLoadDoesNotBlurWhatIsSmallBesideIt) {
  for (const int count : {40, 140}) {
    std::vector<Mode> modes;
    for (int m = 0; m < count; ++m) modes.push_back({150.0 + 150.0 * m, 60.0, 1.0});
    EXPECT_LT(calc_error_db(modes, Isa::kBest, 4096.0F), -120.0) << count;
  }
}

TEST(DrivenBank, SizesOfCallsDoNotChangeABit) {
  const auto model = make_model(make_modes(130));
  const std::vector<float> force = make_noise(2000);
  for (const Isa isa : {Isa::kPlain, Isa::kSse2, Isa::kAvx2, Isa::kAvx512}) {
    std::vector<float> expected(force.size(), 0.0F);
    DrivenBank whole(*model, 0, {1.0, 0.0, 0.0}, {0.0, 0.0, 1.0}, isa);
    whole.process(force, expected);
    for (const std::size_t size : {1UL, 7UL, 32UL, 64UL, 128UL, 511UL}) {
      std::vector<float> pressure(force.size(), 0.0F);
      DrivenBank bank(*model, 0, {1.0, 0.0, 0.0}, {0.0, 0.0, 1.0}, isa);
      for (std::size_t n = 0; n < force.size(); n += size) {
        const std::size_t count = std::min(size, force.size() - n);
        bank.process(std::span(force).subspan(n, count), std::span(pressure).subspan(n, count));
      }
      EXPECT_EQ(pressure, expected) << get_name(isa) << ", calls of " << size;
    }
  }
}

TEST(DrivenBank, WhatIsNotFiniteIsCountedAndNeverHeard) {
  const auto model = make_model(make_modes(60));
  std::vector<float> force = make_noise(1000), held = force;
  for (const std::size_t n : {200UL, 201UL, 399UL}) {
    force[n] = n == 201 ? std::numeric_limits<float>::quiet_NaN() : std::numeric_limits<float>::infinity();
    held[n] = held[n - 1];
  }
  std::vector<float> pressure(1000, 0.0F), expected(1000, 0.0F);
  DrivenBank bank(*model, 0, {1.0, 0.0, 0.0}, {0.0, 0.0, 1.0}), other(*model, 0, {1.0, 0.0, 0.0}, {0.0, 0.0, 1.0});
  bank.process(force, pressure);
  other.process(held, expected);
  EXPECT_EQ(pressure, expected);
  EXPECT_EQ(bank.get_fault_count(), 3);
  EXPECT_EQ(other.get_fault_count(), 0);

  // Numbers that overflow silence the body; then it is as new.
  force.resize(1024, 0.0F), pressure.resize(1024);
  for (std::size_t n = 0; n < force.size(); ++n) force[n] = n >= 200 ? 0.0F : n % 2 == 0 ? 3e38F : -3e38F;
  std::fill(pressure.begin(), pressure.end(), 0.0F);
  DrivenBank broken(*model, 0, {1.0, 0.0, 0.0}, {0.0, 0.0, 1.0});
  broken.process(force, pressure);
  EXPECT_GT(broken.get_fault_count(), 0);
  for (const float p : pressure) ASSERT_TRUE(std::isfinite(p));
  const std::vector<float> noise = make_noise(1000);
  std::vector<float> again(1000, 0.0F), anew(1000, 0.0F);
  DrivenBank fresh(*model, 0, {1.0, 0.0, 0.0}, {0.0, 0.0, 1.0});
  broken.process(noise, again);
  fresh.process(noise, anew);
  EXPECT_EQ(again, anew);
}

TEST(DrivenBank, LowModesStayInTuneForAMinute) {
  for (const double freq : {20.0, 100.0, 990.0, 1010.0, 20000.0}) {
    DrivenBank bank(*make_model({{freq, 0.0, 1.0}}), 0, {1.0, 0.0, 0.0}, {0.0, 0.0, 1.0});
    std::vector<float> force(48000, 0.0F), pressure(48000, 0.0F);
    force[0] = 1.0F;
    bank.process(force, pressure);
    force[0] = 0.0F;
    for (int second = 1; second < 60; ++second) {
      std::fill(pressure.begin(), pressure.end(), 0.0F);
      bank.process(force, pressure);
    }
    // The phase of the last second against that of the closed form, in cents of the frequency.
    double cosine = 0.0, sine = 0.0;
    for (int n = 0; n < 48000; ++n) {
      const double t = std::fmod(freq * (59.0 + (n + 0.5) / kRate), 1.0) * 2.0 * pi;  // the middle of the hold
      cosine += pressure[static_cast<std::size_t>(n)] * std::cos(t), sine += pressure[static_cast<std::size_t>(n)] * std::sin(t);
    }
    const double cycles = std::atan2(sine, cosine) / (2.0 * pi);
    EXPECT_LT(1200.0 * std::log2(1.0 + std::abs(cycles) / (59.5 * freq)), 0.01) << freq;
  }
}

TEST(DrivenBank, BadPlacesAreRefused) {
  const auto model = make_model({{440.0, 1.0, 1.0}});
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(DrivenBank(*model, 12, {1, 0, 0}, {0, 0, 1}), InputError);
  EXPECT_THROW(DrivenBank(*model, -1, {1, 0, 0}, {0, 0, 1}), InputError);
  EXPECT_THROW(DrivenBank(*model, 0, {nan, 0, 0}, {0, 0, 1}), InputError);
  EXPECT_THROW(DrivenBank(*model, 0, {1, 0, 0}, {0, nan, 1}), InputError);
}

}  // namespace
}  // namespace carillon::synth
