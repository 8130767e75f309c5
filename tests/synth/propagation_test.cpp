#include "runtime/synth/propagation.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "runtime/config/error.hpp"

namespace carillon::synth {
namespace {

using std::numbers::pi;
constexpr double kRate = 48000.0;

Path make_still(const Vec3& position_m) { return Path(std::vector<Path::Point>{{0.0, position_m}}); }

std::vector<double> make_tone(double freq_hz, std::size_t samples) {
  std::vector<double> tone(samples);
  for (std::size_t n = 0; n < samples; ++n) tone[n] = std::sin(2 * pi * freq_hz * n / kRate);
  return tone;
}

/// What arrives, with the latency taken off.
std::vector<double> receive(const Path& path, const Vec3& ear, std::vector<double> pressure, std::size_t block = 100) {
  pressure.resize(pressure.size() + Propagation::kLatency, 0.0);
  std::vector<double> received(pressure.size(), 0.0);
  Propagation propagation(path, ear, kRate, 100.0);
  for (std::size_t n = 0; n < pressure.size(); n += block) {
    const std::size_t count = std::min(block, pressure.size() - n);
    propagation.process(std::span<const double>(pressure).subspan(n, count), std::span(received).subspan(n, count));
  }
  received.erase(received.begin(), received.begin() + Propagation::kLatency);
  return received;
}

/// Amplitude and phase of a frequency in part of a signal (Hann window).
std::complex<double> calc_component(const std::vector<double>& x, double freq_hz, std::size_t from, std::size_t count) {
  std::complex<double> sum = 0.0;
  double total = 0.0;
  for (std::size_t i = 0; i < count; ++i) {
    const double window = 0.5 - 0.5 * std::cos(2 * pi * (i + 0.5) / count);
    sum += window * x[from + i] * std::polar(1.0, -2 * pi * freq_hz * static_cast<double>(from + i) / kRate);
    total += window;
  }
  return 2.0 * sum / total;
}

TEST(Propagation, SoundTakesItsTimeAndFallsAsOneOverDistance) {
  // 3.43 m are exactly 480 samples.
  std::vector<double> click(1000, 0.0);
  click[20] = 1.0;
  const Path path = make_still({3.43, 0.0, 0.0});
  const auto heard = receive(path, {0.0, 0.0, 0.0}, click);
  for (std::size_t n = 0; n < heard.size(); ++n) ASSERT_NEAR(heard[n], n == 500 ? 1.0 / 3.43 : 0.0, 1e-9) << n;
  const auto near = receive(make_still({1.715, 0.0, 0.0}), {0.0, 0.0, 0.0}, click);
  EXPECT_NEAR(near[260] / heard[500], 2.0, 1e-9);
}

TEST(Propagation, AFractionOfASampleKeepsLevelAndPhaseUpTo18KHz) {
  for (const double freq : {100.0, 1000.0, 10000.0, 18000.0}) {
    for (const double metres : {1.0, 1.00333, 2.345}) {
      const auto heard = receive(make_still({0.0, metres, 0.0}), {0.0, 0.0, 0.0}, make_tone(freq, 12000));
      const std::complex<double> expected = std::polar(1.0 / metres, -pi / 2 - 2 * pi * freq * metres / 343.0);
      EXPECT_LT(std::abs(calc_component(heard, freq, 2000, 9600) - expected) * metres, 1e-3) << freq << " Hz, " << metres << " m";
    }
  }
}

TEST(Propagation, AMovingSourceIsHeardWithItsDopplerShift) {
  for (const double speed : {20.0, -20.0, 2.2}) {
    // Along the line of sight: positive speed comes nearer.
    const double start = speed > 0.0 ? 60.0 : 10.0;
    const Path path({{0.0, {start, 0.0, 0.0}}, {1.0, {start - speed, 0.0, 0.0}}, {2.0, {start - 2 * speed, 0.0, 0.0}}});
    const auto heard = receive(path, {0.0, 0.0, 0.0}, make_tone(1000.0, 96000));
    const double expected = 1000.0 / (1.0 - speed / 343.0);
    // Phase advance between two stretches one tenth of a second apart gives the frequency.
    const double hop = 0.1;
    const auto a = calc_component(heard, expected, 48000, 2400);
    const auto b = calc_component(heard, expected, 48000 + 4800, 2400);
    const double measured = expected + std::arg(b / a) / (2 * pi * hop);
    EXPECT_NEAR(measured, expected, 1e-3 * expected) << speed;
    EXPECT_NEAR(measured, expected, 0.02) << speed;
    EXPECT_GT(std::abs(a), 0.01);
  }
}

TEST(Propagation, TwoEarsHearASideSourceInterauralTimeApart) {
  // From the side 20 cm are 583.09 us = 27.99 samples at 48 kHz.
  const Path path = make_still({0.0, 2.0, 0.0});
  const double freq = 500.0;
  const auto left = calc_component(receive(path, {0.0, 0.1, 0.0}, make_tone(freq, 9600)), freq, 2400, 4800);
  const auto right = calc_component(receive(path, {0.0, -0.1, 0.0}, make_tone(freq, 9600)), freq, 2400, 4800);
  EXPECT_NEAR(std::arg(left / right) / (2 * pi * freq), 583.09e-6, 0.02e-6);
  EXPECT_NEAR(std::abs(left) / std::abs(right), 2.1 / 1.9, 1e-4);
}

TEST(Propagation, BlockSizeDoesNotChangeTheSound) {
  const Path path({{0.0, {3.0, 0.0, 0.0}}, {0.05, {2.5, 0.1, 0.0}}, {0.1, {2.0, 0.5, 1.0}}});
  const auto one = receive(path, {0.0, 0.0, 0.0}, make_tone(3000.0, 4800), 1);
  const auto many = receive(path, {0.0, 0.0, 0.0}, make_tone(3000.0, 4800), 511);
  for (std::size_t n = 0; n < one.size(); ++n) ASSERT_EQ(one[n], many[n]);
}

TEST(Propagation, ASourceAtTheEarStaysFinite) {
  const auto heard = receive(make_still({0.0, 0.0, 0.0}), {0.0, 0.0, 0.0}, make_tone(1000.0, 1000));
  for (const double p : heard) ASSERT_LE(std::abs(p), 1.001 / kNearestM);
}

TEST(Propagation, APathPassesItsPointsWithoutJumpsOfSpeed) {
  const Path path({{0.0, {0.0, 0.0, 0.0}}, {0.1, {1.0, 0.0, 0.0}}, {0.3, {1.0, 2.0, 0.0}}, {0.4, {0.0, 2.0, 1.0}}});
  std::size_t hint = 0;
  EXPECT_NEAR(path.find_position(0.1, hint)[0], 1.0, 1e-12);
  EXPECT_NEAR(path.find_position(0.3, hint)[1], 2.0, 1e-12);
  EXPECT_NEAR(path.find_position(9.0, hint)[2], 1.0, 1e-12);
  EXPECT_NEAR(path.find_position(-1.0, hint)[0], 0.0, 1e-12);
  const double h = 1e-6;
  for (const double knot : {0.1, 0.3}) {
    for (int k = 0; k < 3; ++k) {
      const double here = path.find_position(knot, hint)[k];
      const double before = (here - path.find_position(knot - h, hint)[k]) / h;
      const double after = (path.find_position(knot + h, hint)[k] - here) / h;
      EXPECT_NEAR(before, after, 1e-2);
    }
  }
  EXPECT_THROW(Path(std::vector<Path::Point>{}), InputError);
  EXPECT_THROW(Path(std::vector<Path::Point>{{1.0, {}}, {0.0, {}}}), InputError);
}

}  // namespace
}  // namespace carillon::synth
