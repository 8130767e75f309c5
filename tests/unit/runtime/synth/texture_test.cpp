// Profile of a rough surface against its specified spectrum.
#include "runtime/synth/texture.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <cstring>
#include <numbers>
#include <vector>

namespace carillon::synth {
namespace {

constexpr double kRate = 48000.0;
constexpr double kRoughness = 1e-6;   // of waves up to 0.8 mm
constexpr double kLongestM = 6.4e-3;  // of the waviness

std::vector<double> read(Texture& texture, double speed_m_s, std::size_t samples, double patch_m, double rate_hz = kRate,
                         double gains_at_hz = kRate) {
  const Texture::Gains gains = texture.calc_gains(speed_m_s, patch_m, 0.0, gains_at_hz);
  std::vector<double> out;
  std::array<float, kSubBlock + 1> height;
  while (out.size() < samples) {
    texture.render(speed_m_s, speed_m_s, rate_hz, gains, gains, height);
    out.insert(out.end(), height.begin(), height.end() - 1);
  }
  return out;
}

/// Power between two frequencies in windows of 4096 samples (Blackman), by plain sums.
double calc_power(const std::vector<double>& x, double from_hz, double to_hz, double rate_hz) {
  constexpr int kWindow = 4096;
  double sum = 0.0, weights = 0.0;
  std::vector<double> window(kWindow);
  for (int n = 0; n < kWindow; ++n) {
    const double a = 2.0 * std::numbers::pi * n / kWindow;
    window[n] = 0.42 - 0.5 * std::cos(a) + 0.08 * std::cos(2.0 * a);
    weights += window[n] * window[n];
  }
  const int first = static_cast<int>(std::ceil(from_hz / rate_hz * kWindow)), last = static_cast<int>(std::ceil(to_hz / rate_hz * kWindow));
  int windows = 0;
  for (std::size_t at = 0; at + kWindow <= x.size(); at += kWindow / 2, ++windows) {
    for (int k = first; k < last; ++k) {
      const std::complex<double> step = std::polar(1.0, -2.0 * std::numbers::pi * k / kWindow);
      std::complex<double> turn = 1.0, bin = 0.0;
      for (int n = 0; n < kWindow; ++n, turn *= step) bin += turn * (window[n] * x[at + n]);
      sum += 2.0 * std::norm(bin);
    }
  }
  return sum / windows / weights / kWindow;
}

/// Line over a self-affine surface: C(q) ~ q^-(1 + 2 H) from the longest wave on; beyond 1 / cut-off the square of the rms height.
double calc_prescribed(double from_per_m, double to_per_m) {
  const double cutoff = 0.8e-3, h = Texture::kHurst;
  const auto beyond = [&](double per_m) { return std::pow(std::max(1.0 / kLongestM, per_m) * cutoff, -2.0 * h); };
  return kRoughness * kRoughness * (beyond(from_per_m) - beyond(to_per_m));
}

TEST(Texture, HasTheSpectrumOfASelfAffineSurfaceReadAtTheSpeed) {
  for (const double speed : {0.4, 0.8, 1.6}) {  // each one octave above the one before
    Texture texture;
    texture.start(kRoughness, 3);
    const std::vector<double> height = read(texture, speed, 16 * 4096, 1e-8);
    for (double low = 1.0; low < 30.0; low *= 1.7) {  // in units of the cut-off's frequency, across the borders of octaves
      const double from = low * speed / 0.8e-3, to = 1.6 * from;
      if (to > 0.2 * kRate) break;
      const double expected = calc_prescribed(from / speed, to / speed);
      EXPECT_NEAR(10.0 * std::log10(calc_power(height, from, to, kRate) / expected), 0.0, 1.2) << speed << " m/s, " << from << " Hz";
    }
    const double below = calc_power(height, 0.0, 0.7 * speed / kLongestM - 3.0 * kRate / 4096.0, kRate);
    EXPECT_LT(below, 1e-3 * kRoughness * kRoughness) << "no longer waves";
  }
}

TEST(Texture, HasTheRequestedRoughness) {
  for (const double roughness : {0.01e-6, 1e-6, 20e-6}) {
    Texture texture;
    texture.start(roughness, 8);
    const double speed = 160.0;  // a long way, to have the longest waves often
    double sum = 0.0, largest = 0.0;
    const std::vector<double> height = read(texture, speed, 480000, 1e-9, 16.0 * kRate, 16.0 * kRate);
    for (const double h : height) {
      sum += h * h;
      largest = std::max(largest, std::abs(h));
    }
    const double wavy = roughness * std::pow(8.0, Texture::kHurst);  // three octaves beyond the cut-off
    EXPECT_NEAR(std::sqrt(sum / static_cast<double>(height.size())), wavy, 0.05 * wavy);
    EXPECT_NEAR(texture.calc_gains(speed, 1e-9, 0.0, 16.0 * kRate).rms_m, wavy, 0.03 * wavy);
    double square = 0.0;
    const Texture::Gains slow = texture.calc_gains(1.0, 1e-9, 0.0, 16.0 * kRate);
    for (std::size_t octave = 3; octave < Texture::kOctaves; ++octave) square += std::pow(static_cast<double>(slow.height_m[octave]), 2.0);
    EXPECT_NEAR(std::sqrt(square), roughness, 0.03 * roughness) << "without the waviness";
    EXPECT_GT(largest, 2.5 * wavy);
    EXPECT_LT(largest, 7.0 * wavy);
  }
}

TEST(Texture, MovesNothingFasterThanTheNyquistFrequency) {
  for (const double speed : {0.5, 7.7}) {
    Texture texture;
    texture.start(kRoughness, 5);
    // The same path and gains, seen eight times as often.
    const std::vector<double> height = read(texture, speed, 3 * 4096, 1e-8, 8.0 * kRate, kRate);
    const double all = calc_power(height, 0.0, 0.5 * kRate, 8.0 * kRate),
                 beyond = calc_power(height, 0.5 * kRate, 4.0 * kRate, 8.0 * kRate);
    EXPECT_LE(beyond, 1e-6 * all) << speed << " m/s";
  }
  Texture texture;
  texture.start(kRoughness, 5);
  EXPECT_EQ(texture.calc_gains(300.0, 1e-8, 0.0, kRate).rms_m, 0.0) << "all beyond the band";
}

TEST(Texture, IsBluntedByThePatchThatTouchesIt) {
  Texture sharp, blunt;
  sharp.start(kRoughness, 6), blunt.start(kRoughness, 6);
  const double speed = 0.8, patch = 50e-6;
  const std::vector<double> x = read(sharp, speed, 6 * 4096, 1e-9), y = read(blunt, speed, 6 * 4096, patch);
  for (const double waves_m : {0.4e-3, 0.2e-3, 0.1e-3}) {  // whole octaves: to half of each
    const double from = speed / waves_m, q = 2.0 * std::numbers::pi * std::numbers::sqrt2 / waves_m;
    const double expected = 1.0 / (1.0 + 0.25 * std::numbers::pi * std::pow(q * patch, 3.0));  // Remington
    EXPECT_NEAR(10.0 * std::log10(calc_power(y, from, 2.0 * from, kRate) / calc_power(x, from, 2.0 * from, kRate)),
                10.0 * std::log10(expected), 0.5)
        << waves_m;
  }
}

TEST(Texture, IsFilteredByTheComplianceOfTheBodies) {
  Texture texture;
  texture.start(kRoughness, 6);
  const double give = 2.0 * std::numbers::pi * 1000.0;
  const Texture::Gains all = texture.calc_gains(0.2, 1e-9, 0.0, kRate), some = texture.calc_gains(0.2, 1e-9, give, kRate);
  for (std::size_t octave = 0; octave < 5; ++octave) {
    const double freq = std::sqrt(2.0) * 0.2 / kLongestM * std::pow(2.0, static_cast<double>(octave));
    EXPECT_NEAR(some.height_m[octave] / all.height_m[octave], 1.0 / (1.0 + std::pow(1000.0 / freq, 2.0)), 1e-3);
  }
}

TEST(Texture, AnotherSpeedIsAnotherFactorAtAllFrequencies) {
  Texture texture;
  texture.start(kRoughness, 6);
  const auto calc_db = [&](double speed, double freq) {
    return 10.0 * std::log10(Texture::calc_density(texture.calc_gains(speed, 1e-9, 0.0, kRate), speed, freq));
  };
  for (double slow = 0.05; slow < 0.7; slow *= 2.0) {
    const double factor_db = 20.0 * Texture::kHurst * std::log10(2.0);
    for (double freq = 2.1 * slow / Texture::kLongestM; freq < 0.15 * kRate; freq *= 1.3)
      EXPECT_NEAR(calc_db(2.0 * slow, freq) - calc_db(slow, freq), factor_db, 0.01) << slow << " m/s, " << freq << " Hz";
  }
}

TEST(Texture, IsTheSameForTheSameSeedAndAnotherForAnother) {
  Texture a, b, c;
  a.start(kRoughness, 1), b.start(kRoughness, 1), c.start(kRoughness, 2);
  const std::vector<double> x = read(a, 0.3, 48000, 1e-8), y = read(b, 0.3, 48000, 1e-8), z = read(c, 0.3, 48000, 1e-8);
  EXPECT_EQ(x, y);
  double xx = 0.0, xz = 0.0, zz = 0.0;
  for (std::size_t n = 0; n < x.size(); ++n) xx += x[n] * x[n], xz += x[n] * z[n], zz += z[n] * z[n];
  EXPECT_LT(std::abs(xz), 0.2 * std::sqrt(xx * zz));
}

TEST(Texture, ContinuesWithoutAStepWhenTheSpeedChanges) {
  Texture texture;
  texture.start(kRoughness, 4);
  std::array<float, kSubBlock + 1> height;
  float last = 0.0F;
  for (int sub_block = 0; sub_block < 500; ++sub_block) {
    const double from = 0.01 * sub_block, to = 0.01 * (sub_block + 1);
    texture.render(from, to, kRate, texture.calc_gains(from, 1e-6, 0.0, kRate), texture.calc_gains(to, 1e-6, 0.0, kRate), height);
    if (sub_block > 0) {
      ASSERT_NEAR(height[0], last, 1e-5 * kRoughness) << sub_block;
    }
    last = height[kSubBlock];
  }
  texture.start(0.0, 4);
  EXPECT_EQ(texture.calc_gains(1.0, 1e-6, 0.0, kRate).rms_m, 0.0) << "smooth";
}

}  // namespace
}  // namespace carillon::synth
