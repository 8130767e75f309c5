// Stages between a body and two ears on one set of signals.
#include "runtime/synth/receiver.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <functional>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "runtime/base/error.hpp"

namespace carillon::synth {
namespace {

using std::numbers::pi;
constexpr double kRate = 48000.0;

Trajectory make_path(std::vector<PathPoint> places) { return make_trajectory(places); }
Trajectory make_still(const Vec3& position_m) { return make_path({{0.0, position_m}}); }

std::vector<double> make_tone(double freq_hz, std::size_t samples) {
  std::vector<double> tone(samples);
  for (std::size_t n = 0; n < samples; ++n) tone[n] = std::sin(2 * pi * freq_hz * n / kRate);
  return tone;
}

/// Sound at an ear, without the latency.
std::vector<double> receive(const Trajectory& path, const Trajectory& listener, const std::vector<double>& pressure,
                            std::size_t block = 100) {
  std::vector<float> sent(pressure.begin(), pressure.end());
  sent.resize(sent.size() + Receiver::kLatency, 0.0F);
  std::vector<double> received(sent.size(), 0.0);
  DelayLine delay_line(100.0, kRate, static_cast<int>(block));
  Receiver ear({0.0, 0.0, 0.0}, kRate);
  for (std::size_t n = 0; n < sent.size(); n += block) {
    const std::size_t count = std::min(block, sent.size() - n);
    delay_line.push(std::span<const float>(sent).subspan(n, count));
    ear.process({.track = &path, .monopole = &delay_line}, listener, static_cast<std::int64_t>(n), std::span(received).subspan(n, count));
  }
  received.erase(received.begin(), received.begin() + Receiver::kLatency);
  return received;
}

std::vector<double> receive(const Trajectory& path, const Vec3& ear, const std::vector<double>& pressure, std::size_t block = 100) {
  return receive(path, make_still(ear), pressure, block);
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

TEST(Ears, SoundTakesItsTimeAndFallsAsOneOverDistance) {
  // 3.43 m are exactly 480 samples.
  std::vector<double> click(1000, 0.0);
  click[20] = 1.0;
  const Trajectory path = make_still({3.43, 0.0, 0.0});
  const auto heard = receive(path, {0.0, 0.0, 0.0}, click);
  for (std::size_t n = 0; n < heard.size(); ++n) ASSERT_NEAR(heard[n], n == 500 ? 1.0 / 3.43 : 0.0, 1e-9) << n;
  const auto near = receive(make_still({1.715, 0.0, 0.0}), {0.0, 0.0, 0.0}, click);
  EXPECT_NEAR(near[260] / heard[500], 2.0, 1e-9);
}

TEST(Ears, AFractionOfASampleKeepsLevelAndPhaseUpTo18KHz) {
  for (const double freq : {100.0, 1000.0, 10000.0, 18000.0}) {
    for (const double metres : {1.0, 1.00333, 2.345}) {
      const auto heard = receive(make_still({0.0, metres, 0.0}), {0.0, 0.0, 0.0}, make_tone(freq, 12000));
      const std::complex<double> expected = std::polar(1.0 / metres, -pi / 2 - 2 * pi * freq * metres / 343.0);
      EXPECT_LT(std::abs(calc_component(heard, freq, 2000, 9600) - expected) * metres, 1e-3) << freq << " Hz, " << metres << " m";
    }
  }
}

TEST(Ears, AMovingSourceIsHeardWithItsDopplerShift) {
  for (const double speed : {20.0, -20.0, 2.2}) {
    // Along the line of sight: positive speed comes nearer.
    const double start = speed > 0.0 ? 60.0 : 10.0;
    const Trajectory path = make_path({{0.0, {start, 0.0, 0.0}}, {1.0, {start - speed, 0.0, 0.0}}, {2.0, {start - 2 * speed, 0.0, 0.0}}});
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

TEST(Ears, TwoEarsHearASideSourceInterauralTimeApart) {
  // From the side 20 cm are 583.09 us = 27.99 samples at 48 kHz.
  const Trajectory path = make_still({0.0, 2.0, 0.0});
  const double freq = 500.0;
  const auto left = calc_component(receive(path, {0.0, 0.1, 0.0}, make_tone(freq, 9600)), freq, 2400, 4800);
  const auto right = calc_component(receive(path, {0.0, -0.1, 0.0}, make_tone(freq, 9600)), freq, 2400, 4800);
  EXPECT_NEAR(std::arg(left / right) / (2 * pi * freq), 583.09e-6, 0.02e-6);
  EXPECT_NEAR(std::abs(left) / std::abs(right), 2.1 / 1.9, 1e-4);
}

TEST(Ears, BlockSizeDoesNotChangeTheSound) {
  const Trajectory path = make_path({{0.0, {3.0, 0.0, 0.0}}, {0.05, {2.5, 0.1, 0.0}}, {0.1, {2.0, 0.5, 1.0}}});
  const auto one = receive(path, {0.0, 0.0, 0.0}, make_tone(3000.0, 4800), 1);
  const auto many = receive(path, {0.0, 0.0, 0.0}, make_tone(3000.0, 4800), 511);
  for (std::size_t n = 0; n < one.size(); ++n) ASSERT_EQ(one[n], many[n]);
}

TEST(Ears, ASourceAtTheEarStaysFinite) {
  const auto heard = receive(make_still({0.0, 0.0, 0.0}), {0.0, 0.0, 0.0}, make_tone(1000.0, 1000));
  for (const double p : heard) ASSERT_LE(std::abs(p), 1.001 / kNearestM);
}

TEST(Ears, APathPassesItsPointsWithoutJumpsOfSpeed) {
  const Trajectory path = make_path({{0.0, {0.0, 0.0, 0.0}}, {0.1, {1.0, 0.0, 0.0}}, {0.3, {1.0, 2.0, 0.0}}, {0.4, {0.0, 2.0, 1.0}}});
  EXPECT_NEAR(path.find(0.1).position_m[0], 1.0, 1e-12);
  EXPECT_NEAR(path.find(0.3).position_m[1], 2.0, 1e-12);
  EXPECT_NEAR(path.find(9.0).position_m[2], 1.0, 1e-12);
  EXPECT_NEAR(path.find(-1.0).position_m[0], 0.0, 1e-12);
  const double h = 1e-6;
  for (const double knot : {0.1, 0.3}) {
    for (int k = 0; k < 3; ++k) {
      const double here = path.find(knot).position_m[k];
      const double before = (here - path.find(knot - h).position_m[k]) / h;
      const double after = (path.find(knot + h).position_m[k] - here) / h;
      EXPECT_NEAR(before, after, 1e-2);
      EXPECT_NEAR(path.find(knot).velocity_m_s[k], after, 1e-3);
    }
  }
  EXPECT_THROW(make_path({}), InputError);
  EXPECT_THROW(make_path({{1.0, {}}, {0.0, {}}}), InputError);
  EXPECT_THROW(make_path({{std::nan(""), {}}}), InputError);
}

// A bouncing ball: both sides of the impact keep their velocity.
TEST(Ears, ATrackKeepsBothSidesOfAnImpact) {
  constexpr double kImpact = 0.01;
  Trajectory track(8);
  EXPECT_TRUE(track.push({0.0, {0.0, 0.0, 0.02}, {1.0, 0.0, -2.0}}));
  EXPECT_TRUE(track.push({0.0, {0.0, 0.0, 0.02}, {1.0, 0.0, -2.0}}));
  EXPECT_TRUE(track.is_still());
  EXPECT_TRUE(track.push({kImpact, {0.01, 0.0, 0.0}, {1.0, 0.0, -2.0}}));
  EXPECT_TRUE(track.push({kImpact, {0.01, 0.0, 0.0}, {1.0, 0.0, 9.0}}));
  EXPECT_TRUE(track.push({kImpact, {0.01, 0.0, 0.0}, {1.0, 0.0, 1.5}}));  // instead of the one before
  EXPECT_TRUE(track.push({0.02, {0.02, 0.0, 0.015}, {1.0, 0.0, 1.5}}));
  for (const double t : {0.001, 0.004, 0.0099}) {
    EXPECT_NEAR(track.find(t).position_m[2], 0.02 - 2.0 * t, 1e-12);
    EXPECT_NEAR(track.find(t).velocity_m_s[2], -2.0, 1e-9);
  }
  for (const double t : {0.01, 0.0101, 0.0155, 0.0199}) {
    EXPECT_NEAR(track.find(t).position_m[2], 1.5 * (t - kImpact), 1e-12);
    EXPECT_NEAR(track.find(t).velocity_m_s[2], 1.5, 1e-9);
  }
}

TEST(Ears, ATrackDropsTheOldestAndRefusesBadWaypoints) {
  Trajectory track(3);
  EXPECT_TRUE(track.is_still());
  EXPECT_EQ(track.find(5.0).position_m[0], 0.0);
  for (int i = 0; i < 5; ++i) EXPECT_TRUE(track.push({1.0 * i, {1.0 * i * i, 0, 0}, {2.0 * i, 0, 0}}));
  for (const double t : {2.0, 2.5, 3.25, 4.0}) EXPECT_NEAR(track.find(t).position_m[0], t * t, 1e-12);  // a parabola is a cubic
  EXPECT_NEAR(track.find(3.25).velocity_m_s[0], 6.5, 1e-12);
  EXPECT_EQ(track.find(1.0).position_m[0], 4.0);  // the oldest that is left
  EXPECT_EQ(track.find(5.0).velocity_m_s[0], 0.0);
  EXPECT_FALSE(track.push({3.5, {}, {}}));
  EXPECT_FALSE(track.push({6.0, {0, std::nan(""), 0}, {}}));
  EXPECT_FALSE(track.push({std::numeric_limits<double>::infinity(), {}, {}}));
  EXPECT_TRUE(track.push({4.0, {9.5, 0, 0}, {}}));  // the other side of a jump; the oldest goes
  EXPECT_EQ(track.find(4.0).position_m[0], 9.5);
  EXPECT_EQ(track.find(2.0).position_m[0], 9.0);
  EXPECT_NEAR(track.find(3.25).position_m[0], 3.25 * 3.25, 1e-12);
}

/// Track of a function of time with exact velocities.
template <class Motion>
Trajectory make_motion(double step_s, double until_s, Motion motion) {
  Trajectory track(static_cast<std::size_t>(until_s / step_s) + 2);
  for (double t = 0.0; t < until_s + step_s; t += step_s) track.push({t, motion(t), {}});
  Trajectory with_velocity(static_cast<std::size_t>(until_s / step_s) + 2);
  for (double t = 0.0; t < until_s + step_s; t += step_s) {
    const Vec3 a = motion(t - 1e-4), b = motion(t + 1e-4);
    with_velocity.push({t, motion(t), {(b[0] - a[0]) / 2e-4, (b[1] - a[1]) / 2e-4, (b[2] - a[2]) / 2e-4}});
  }
  return with_velocity;
}

/// Frequency about `centre_hz` over time: phase of the demodulated signal in a window of 10 ms every 1 ms.
std::vector<double> calc_frequency_hz(const std::vector<double>& x, double centre_hz) {
  constexpr std::size_t kWindow = 480, kHop = 48;
  std::vector<double> freq;
  std::complex<double> last = 0.0;
  for (std::size_t start = 0; start + kWindow <= x.size(); start += kHop) {
    const std::complex<double> here = calc_component(x, centre_hz, start, kWindow);
    freq.push_back(start == 0 ? centre_hz : centre_hz + std::arg(here / last) * kRate / (kHop * 2 * pi));
    last = here;
  }
  return freq;
}

TEST(Ears, OneKilohertzPassingAt20MetresPerSecondHasTheExactDopplerShift) {
  // On the line y = 2 m past the listener. Retarded time by the quadratic equation, frequency 1000 dt'/dt.
  constexpr double kSpeed = 20.0, kAside = 2.0, kC = 343.0, kPassing = 1.0;
  const Trajectory path = make_motion(0.002, 2.0, [](double t) { return Vec3{kSpeed * (t - kPassing), kAside, 0.0}; });
  const auto heard = receive(path, Vec3{0.0, 0.0, 0.0}, make_tone(1000.0, 96000));
  const auto freq = calc_frequency_hz(heard, 1000.0);
  double worst = 0.0, highest = 0.0, lowest = 1e9;
  for (std::size_t i = 100; i + 20 < freq.size(); ++i) {
    const double t = (48.0 * static_cast<double>(i) + 240.0 - 24.0 - 0.5) / kRate - kPassing;
    // c^2 (t - s)^2 = v^2 s^2 + b^2
    const double a = kC * kC - kSpeed * kSpeed, b = kC * kC * t, c = kC * kC * t * t - kAside * kAside;
    const double root = std::sqrt(b * b - a * c), s = (b - root) / a;
    const double expected = 1000.0 * (kC * kC - (kC * kC * kC * kC * t - a * kC * kC * t) / root) / a;
    worst = std::max(worst, std::abs(freq[i] / expected - 1.0));
    highest = std::max(highest, freq[i]);
    lowest = std::min(lowest, freq[i]);
    const std::complex<double> level = calc_component(heard, expected, 48 * i, 432);
    const double mach = -kSpeed * kSpeed * s / std::hypot(kSpeed * s, kAside) / kC;
    EXPECT_NEAR(std::abs(level) * std::hypot(kSpeed * s, kAside) * (1.0 - mach) * (1.0 - mach), 1.0, 0.01) << t;
  }
  EXPECT_LT(worst, 1e-3);
  RecordProperty("worst", std::to_string(worst));
  EXPECT_LT(worst, 1e-4);  // error of the interpolation
  EXPECT_GT(highest, 1060.0);
  EXPECT_LT(lowest, 947.0);
}

TEST(Ears, APendulumSwingsInPitchAndLevel) {
  // 500 Hz, amplitude 0.5 m at 0.7 Hz along the line of sight, 2 m away: 496.8147 to 503.2264 Hz, and a level that swings with
  // 1 / r (1 - M)^2.
  const Trajectory path = make_motion(0.002, 6.0, [](double t) { return Vec3{2.0 + 0.5 * std::sin(2 * pi * 0.7 * t), 0.0, 0.0}; });
  const auto heard = receive(path, Vec3{0.0, 0.0, 0.0}, make_tone(500.0, 6 * 48000));
  double highest = 0.0, lowest = 1e9, loudest = 0.0, softest = 1e9;
  const auto freq = calc_frequency_hz(heard, 500.0);
  for (std::size_t i = 100; i < freq.size(); ++i) {
    highest = std::max(highest, freq[i]);
    lowest = std::min(lowest, freq[i]);
    const double level = std::abs(calc_component(heard, 500.0, 48 * i, 480));
    loudest = std::max(loudest, level);
    softest = std::min(softest, level);
  }
  EXPECT_NEAR(lowest, 496.8147, 0.01);
  EXPECT_NEAR(highest, 503.2264, 0.01);
  double max = 0.0, min = 1e9;
  for (double t = 0.0; t < 1.0 / 0.7; t += 1e-4) {
    const double angle = 2 * pi * 0.7 * t, mach = -0.5 * 2 * pi * 0.7 * std::cos(angle) / 343.0;
    const double level = 1.0 / ((2.0 + 0.5 * std::sin(angle)) * (1.0 - mach) * (1.0 - mach));
    max = std::max(max, level), min = std::min(min, level);
  }
  EXPECT_NEAR(20 * std::log10(loudest / softest), 20 * std::log10(max / min), 0.005);
}

/// Discrete Fourier transform in place; power-of-two size.
void transform(std::vector<std::complex<double>>& x) {
  if (x.size() == 1) return;
  std::vector<std::complex<double>> even, odd;
  for (std::size_t i = 0; i < x.size(); ++i) (i % 2 == 0 ? even : odd).push_back(x[i]);
  transform(even);
  transform(odd);
  for (std::size_t k = 0; k < x.size() / 2; ++k) {
    const auto turned = std::polar(1.0, -2 * pi * static_cast<double>(k) / static_cast<double>(x.size())) * odd[k];
    x[k] = even[k] + turned;
    x[k + x.size() / 2] = even[k] - turned;
  }
}

TEST(Ears, AMovingToneHasNoSideLines) {
  // 10 kHz from a source that comes nearer at 5 m/s: one line at f / (1 - v / c), everything else 80 dB below it.
  const Trajectory path = make_motion(0.002, 3.0, [](double t) { return Vec3{25.0 - 5.0 * t, 0.0, 0.0}; });
  const auto heard = receive(path, Vec3{0.0, 0.0, 0.0}, make_tone(10000.0, 3 * 48000));
  std::vector<std::complex<double>> x(65536);
  for (std::size_t n = 0; n < x.size(); ++n) {
    const double u = 2 * pi * (static_cast<double>(n) + 0.5) / static_cast<double>(x.size());
    const double window =
        0.3635819 - 0.4891775 * std::cos(u) + 0.1365995 * std::cos(2 * u) - 0.0106411 * std::cos(3 * u);  // Nuttall, -98 dB
    const double t = static_cast<double>(n + 48000) / kRate;
    x[n] = window * heard[n + 48000] * (25.0 - 5.0 * t) / (1.0 - 5.0 / 343.0);  // the growth of 1/r taken off
  }
  transform(x);
  const double line = 10000.0 / (1.0 - 5.0 / 343.0) / kRate * static_cast<double>(x.size());
  double peak = 0.0, rest = 0.0;
  for (std::size_t k = 0; k < x.size() / 2; ++k) {
    (std::abs(static_cast<double>(k) - line) < 6.0 ? peak : rest) =
        std::max(std::abs(x[k]), std::abs(static_cast<double>(k) - line) < 6.0 ? peak : rest);
  }
  RecordProperty("side_lines_db", std::to_string(20 * std::log10(rest / peak)));
  EXPECT_LT(20 * std::log10(rest / peak), -80.0);
}

TEST(Ears, ASourceThatGathersSpeedIsHeardAsTheClosedForm) {
  // 10 kHz from x = 5 + 25 t^2: straight pieces of delay over a sub-block would be 5e-4 rad off in their middle.
  const auto x = [](double t) { return 5.0 + 25.0 * t * t; };
  const Trajectory path = make_motion(0.002, 1.0, [&](double t) { return Vec3{x(t), 0.0, 0.0}; });
  const auto heard = receive(path, Vec3{0.0, 0.0, 0.0}, make_tone(10000.0, 36000));
  for (std::size_t n = 2400; n < 35900; ++n) {
    // t' + (5 + 25 t'^2) / c = t
    const double t = static_cast<double>(n) / kRate, sent = (-343.0 + std::sqrt(343.0 * 343.0 + 100.0 * (343.0 * t - 5.0))) / 50.0;
    const double mach = -50.0 * sent / 343.0;
    ASSERT_NEAR(heard[n] * x(sent) * (1.0 - mach) * (1.0 - mach), std::sin(2 * pi * 10000.0 * sent), 1e-4) << n;
  }
}

/// Sound of a moving volume source in a short window, by the wave equation's integral over emission times, p = d/dt of the integral of Q(s)
/// delta(t - s - r(s) / c) / r(s), Q' the pressure at 1 m of the resting source. `side_m`: two opposite sources this far apart along x,
/// over that distance; 0: one.
std::vector<double> calc_windowed(const std::vector<double>& times_s, double width_s, double freq_hz, double side_m,
                                  const std::function<Vec3(double)>& way) {
  std::vector<double> seen;
  for (const double t : times_s) {
    double sum = 0.0;
    constexpr double kStep = 2e-6;
    for (const double sign : side_m > 0.0 ? std::vector<double>{1.0, -1.0} : std::vector<double>{0.0}) {
      for (double s = t - 0.15; s < t + 5.0 * width_s; s += kStep) {
        const Vec3 x = way(s);
        const double r = std::hypot(x[0] + 0.5 * sign * side_m, x[1], x[2]), u = (t - s - r / 343.0) / width_s;
        if (std::abs(u) > 7.0) continue;
        const double slope = -u / width_s * std::exp(-0.5 * u * u);
        sum += (side_m > 0.0 ? sign / side_m : 1.0) * -std::cos(2 * pi * freq_hz * s) / (2 * pi * freq_hz) * slope / r * kStep;
      }
    }
    seen.push_back(sum);
  }
  return seen;
}

TEST(Ears, ApproachingSourcesAreLouderByTheWaveEquation) {
  constexpr double kFreq = 1000.0, kWidth = 0.2e-3;
  for (const double speed : {5.0, 20.0, 60.0}) {
    const auto way_of = [&](double t) { return Vec3{speed * (t - 0.5), 3.0, 1.0}; };
    const Trajectory path = make_motion(0.002, 1.0, way_of);
    std::vector<double> tone = make_tone(kFreq, 48000);
    const auto see = [&](const std::vector<double>& heard, double t) {
      double sum = 0.0;
      for (std::size_t n = 0; n < heard.size(); ++n) {
        const double u = (t - static_cast<double>(n) / kRate) / kWidth;
        if (std::abs(u) < 7.0) sum += heard[n] * std::exp(-0.5 * u * u) / kRate;
      }
      return sum;
    };
    std::vector<double> times;
    for (double t = 0.25; t < 0.85; t += 0.0371) times.push_back(t), times.push_back(t + 0.25 / kFreq);
    // One volume source; and two opposite ones side by side, which are a dipole of cosine 1 / c times the slope of the pressure.
    const std::vector<double> heard = receive(path, Vec3{0.0, 0.0, 0.0}, tone);
    const std::vector<double> one = calc_windowed(times, kWidth, kFreq, 0.0, way_of);
    std::vector<float> slope(tone.size() + Receiver::kLatency, 0.0F), zero(slope.size(), 0.0F);
    for (std::size_t n = 0; n < tone.size(); ++n) slope[n] = static_cast<float>(std::cos(2 * pi * kFreq * static_cast<double>(n) / kRate));
    DelayLine along(100.0, kRate, static_cast<int>(slope.size())), silent(100.0, kRate, static_cast<int>(slope.size()));
    along.push(slope);
    silent.push(zero);
    std::vector<double> felt(slope.size(), 0.0);
    Receiver({0.0, 0.0, 0.0}, kRate).process({.track = &path, .dipole = {&along, &silent, &silent}}, make_still({0.0, 0.0, 0.0}), 0, felt);
    felt.erase(felt.begin(), felt.begin() + Receiver::kLatency);
    const std::vector<double> two = calc_windowed(times, kWidth, kFreq, 2e-3, way_of);
    const double unit = 2 * pi * kFreq / 343.0;  // of the dipole of sources 1 m apart
    double largest = 0.0;
    for (const double x : one) largest = std::max(largest, std::abs(x));
    for (std::size_t i = 0; i < times.size(); ++i) {
      const double distance = std::hypot(way_of(times[i])[0], 3.0, 1.0);
      const double slack = speed / (2 * pi * kFreq * distance) * 2.0 + 1e-3;  // near field of a moving source
      EXPECT_NEAR(see(heard, times[i]), one[i], slack * largest) << speed << " m/s, " << times[i] << " s";
      EXPECT_NEAR(unit * see(felt, times[i]), two[i], (slack + 1.5 / (unit * distance)) * unit * largest) << speed << " m/s, " << times[i];
    }
  }
}

TEST(Ears, AMovingListenerHearsTheClosedForm) {
  // A still source of a 1 kHz tone: p = sin(2 pi f (t - r(t) / c)) / r(t) with the listener's own r(t).
  const auto walk = [](double t) { return Vec3{-3.0 + 8.0 * t, 1.0 + 0.5 * std::sin(6.0 * t), 0.2}; };
  const Trajectory listener = make_motion(0.001, 1.0, walk);
  const auto heard = receive(make_still({0.0, 0.0, 0.0}), listener, make_tone(1000.0, 48000));
  for (std::size_t n = 2000; n < 47000; ++n) {
    const double t = static_cast<double>(n) / kRate;
    const Vec3 x = walk(t);
    const double r = std::hypot(x[0], x[1], x[2]);
    ASSERT_NEAR(heard[n] * r, std::sin(2 * pi * 1000.0 * (t - r / 343.0)), 5e-4) << n;
  }
}

TEST(Ears, AMovingListenerIsAMovingSourceMirroredInTime) {
  // Sound from a source at X(s) to the origin at t takes as long as sound from the origin at -t to a listener at X(s) at -s.
  const auto way_of = [](double t) { return Vec3{-3.0 + 20.0 * t, 2.0 - t * t, 0.5}; };
  const Trajectory moving = make_motion(0.002, 1.0, way_of);
  const Trajectory mirrored = make_motion(0.002, 1.0, [&](double t) { return way_of(1.0 - t); });  // runs from s = 1 back to 0
  const Trajectory still = make_still({0.0, 0.0, 0.0});
  for (double t = 0.1; t < 0.95; t += 0.01) {
    const PathState way = calc_path_state(moving, still, {0.0, 0.0, 0.0}, t);
    const double sent = t - way.delay_s;
    const PathState back = calc_path_state(still, mirrored, {0.0, 0.0, 0.0}, 1.0 - sent);
    EXPECT_NEAR(back.delay_s, way.delay_s, 1e-9) << t;
    EXPECT_NEAR(back.spreading_1_m, way.spreading_1_m, 1e-9) << t;
    EXPECT_NEAR((1.0 - way.delay_slope) * (1.0 - back.delay_slope), 1.0, 1e-6) << t;  // one pace is the other's inverse
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(back.direction[k], -way.direction[k], 1e-9);
  }
}

TEST(Ears, TheSlopesOfAWayAreItsDerivatives) {
  const Trajectory path = make_motion(0.002, 1.0, [](double t) { return Vec3{std::cos(7.0 * t), std::sin(9.0 * t), 2.0 * t}; });
  const Trajectory listener = make_motion(0.002, 1.0, [](double t) { return Vec3{2.0 + 10.0 * t, 1.0, -t}; });
  const double h = 1e-5;
  for (double t = 0.1; t < 0.9; t += 0.0531) {
    const PathState a = calc_path_state(path, listener, {0.0, 0.3, 0.0}, t - h),
                    b = calc_path_state(path, listener, {0.0, 0.3, 0.0}, t + h);
    const PathState way = calc_path_state(path, listener, {0.0, 0.3, 0.0}, t);
    EXPECT_NEAR(way.delay_slope, (b.delay_s - a.delay_s) / (2 * h), 1e-6);
    EXPECT_NEAR(way.spreading_slope, (b.spreading_1_m - a.spreading_1_m) / (2 * h), 1e-3);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(way.direction_slope[k], (b.direction[k] - a.direction[k]) / (2 * h), 1e-3);
  }
}

TEST(Ears, ADipoleIsHeardByItsCosine) {
  const Trajectory path = make_still({0.0, 0.0, 0.0});
  const Vec3 place{0.6, -0.8, 2.4};  // 2.6 m away
  std::vector<float> tone(4800);
  for (std::size_t n = 0; n < tone.size(); ++n) tone[n] = static_cast<float>(std::sin(2 * pi * 500.0 * static_cast<double>(n) / kRate));
  DelayLine loud(10.0, kRate, 4800), silent(10.0, kRate, 4800);
  loud.push(tone);
  silent.push(std::vector<float>(4800, 0.0F));
  for (std::size_t axis = 0; axis < 3; ++axis) {
    Source source{.track = &path};
    source.dipole.fill(&silent);
    source.dipole[axis] = &loud;
    std::vector<double> heard(4800, 0.0);
    Receiver({0.0, 0.0, 0.0}, kRate).process(source, make_still(place), 0, heard);
    const double expected = std::abs(place[axis]) / 2.6 / 2.6;
    EXPECT_NEAR(std::abs(calc_component(heard, 500.0, 960, 1920)), expected, 1e-4 * expected);
    EXPECT_NEAR(heard[2000] / heard[2000 + 96], 1.0, 1e-3);
    EXPECT_GT(place[axis] * heard[480 + 16 + 24 + 364], 0.0);  // 364 samples of travel and a quarter of a block: the sign of the cosine
  }
}

TEST(Ears, EveryInstructionSetHearsTheSame) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> number(-1.0F, 1.0F);
  std::vector<std::vector<float>> sent(4, std::vector<float>(2000));
  for (std::vector<float>& part : sent)
    for (float& x : part) x = number(random);
  const Trajectory listener = make_still({0.0, 0.0, 0.0});
  for (const Trajectory& path :
       {make_still({1.0, 0.3, -0.2}), make_path({{0.0, {1.0, 0.0, 0.0}}, {0.02, {1.5, 0.2, 0.1}}, {0.04, {1.2, 0.0, -0.3}}})}) {
    std::vector<double> plain;
    for (const Isa isa : base::list_instructions()) {
      std::vector<DelayLine> delay_lines(4, DelayLine(10.0, kRate, 77));
      const Source source{&path, delay_lines.data(), {&delay_lines[1], &delay_lines[2], &delay_lines[3]}};
      Receiver ear({0.0, 0.1, 0.0}, kRate, {Effect::kAirDelay, Effect::kDoppler}, isa);
      std::vector<double> heard(2000, 0.0);
      for (std::size_t n = 0; n < heard.size(); n += 77) {
        const std::size_t count = std::min<std::size_t>(77, heard.size() - n);
        for (std::size_t k = 0; k < 4; ++k) delay_lines[k].push(std::span<const float>(sent[k]).subspan(n, count));
        ear.process(source, listener, static_cast<std::int64_t>(n), std::span(heard).subspan(n, count));
      }
      if (isa == Isa::kPlain) plain = heard;
      double size = 0.0;
      for (std::size_t n = 0; n < heard.size(); ++n) {
        ASSERT_NEAR(heard[n], plain[n], 2e-6) << get_name(isa) << " " << n;
        size += heard[n] * heard[n];
      }
      EXPECT_GT(size, 100.0);
    }
  }
}

TEST(Ears, ImpossibleSizesAreRefused) {
  EXPECT_THROW(DelayLine(1e6, kRate, 512), InputError);
  EXPECT_THROW(DelayLine(-1.0, kRate, 512), InputError);
  EXPECT_THROW(DelayLine(10.0, 0.0, 512), InputError);
  EXPECT_THROW(DelayLine(10.0, kRate, 0), InputError);
}

// The same place given once, twice with negligible velocities, and after a walk: the first and the last use the cheap path.
TEST(Ears, RestingSourcesSoundAsBarelyMovingOnes) {
  std::vector<double> noise(6000);
  std::mt19937 random(2);
  std::normal_distribution<double> normal;
  for (double& x : noise) x = normal(random);
  const Vec3 place{0.3, 2.345, 0.1};
  Trajectory still(4), creeping(4), arrived(4);
  still.push({0.0, place, {}});
  creeping.push({0.0, place, {1e-14, 0.0, 0.0}});
  creeping.push({10.0, place, {1e-14, 0.0, 0.0}});
  arrived.push({-1.0, {0.0, 1.0, 0.0}, {1.0, 0.0, 0.0}});
  arrived.push({-0.5, place, {}});
  arrived.push({0.05, place, {}});
  EXPECT_TRUE(arrived.is_still_from(-0.5));
  EXPECT_FALSE(arrived.is_still_from(-0.6));
  EXPECT_FALSE(creeping.is_still_from(1.0));
  const auto a = receive(still, {0.1, 0.0, 0.0}, noise), b = receive(creeping, {0.1, 0.0, 0.0}, noise),
             c = receive(arrived, {0.1, 0.0, 0.0}, noise), odd = receive(still, {0.1, 0.0, 0.0}, noise, 37);
  for (std::size_t n = 0; n < a.size(); ++n) {
    ASSERT_NEAR(a[n], b[n], 2e-6) << n;
    ASSERT_EQ(a[n], c[n]) << n;
    ASSERT_EQ(a[n], odd[n]) << n;
  }
  EXPECT_GT(*std::max_element(a.begin(), a.end()), 0.5);
}

TEST(Ears, CountSamplesWithAChangingPath) {
  Trajectory track(8), listener(1);
  track.push({0.0, {0.0, 1.0, 0.0}, {}});
  DelayLine delay_line(100.0, kRate, 32);
  std::vector<double> out(32);
  const std::vector<float> ones(32, 1.0F);
  Receiver ear({0.0, 0.0, 0.0}, kRate);
  const auto run = [&](int from, int to) {
    int moved = 0;
    for (int n = from; n < to; n += 32) {
      delay_line.push(ones);
      moved += ear.process({.track = &track, .monopole = &delay_line}, listener, n, out);
    }
    return moved;
  };
  EXPECT_EQ(run(0, 4800), 0);
  track.push({0.1, {0.0, 1.0, 0.0}, {3.0, 0.0, 0.0}});
  track.push({0.2, {0.3, 1.0, 0.0}, {}});
  EXPECT_NEAR(run(4800, 14400), 4800 + 2 * 48, 150);  // for as long as it moves, late by the way
  EXPECT_EQ(run(14400, 19200), 0);
}

TEST(DelayLine, HoldsSamplesForTheTravelTime) {
  for (const double longest_m : {0.0, 1.0, 7.7}) {
    constexpr int kBlock = 50;
    DelayLine delay_line(longest_m, kRate, kBlock);
    std::vector<float> all;
    std::mt19937 random(4);
    std::uniform_int_distribution<int> any(1, kBlock);
    const auto get = [&all](std::int64_t n) { return n < 0 ? 0.0F : all[n]; };
    const auto longest = static_cast<std::int64_t>(longest_m / 343.0 * kRate);
    for (int push = 0; push < 300; ++push) {
      std::vector<float> samples(any(random));
      const bool silent = push % 11 == 3;
      for (float& x : samples) x = silent ? 0.0F : static_cast<float>(any(random));
      all.insert(all.end(), samples.begin(), samples.end());
      if (silent)
        delay_line.push_silence(static_cast<std::int64_t>(samples.size()));
      else
        delay_line.push(samples);
      const auto size = static_cast<std::int64_t>(all.size());
      ASSERT_EQ(delay_line.get_position(), size);
      ASSERT_FALSE(delay_line.is_silent());
      for (const int count : {1, kTaps, kTaps + kBlock}) {
        for (std::int64_t first = size - longest - kTaps - kBlock; first + count <= size; first += 13) {
          const float* found = delay_line.find(first, count);
          for (int i = 0; i < count; ++i) ASSERT_EQ(found == nullptr ? 0.0F : found[i], get(first + i)) << push << " " << first << " " << i;
        }
        EXPECT_EQ(delay_line.find(size - count + 1, count), nullptr);
        EXPECT_EQ(delay_line.find(size - delay_line.get_size() - 1, count), nullptr);
      }
    }
    EXPECT_LE(delay_line.get_bytes(), sizeof(float) * static_cast<std::size_t>(longest + 4 * kTaps + 2 * kBlock + 1));
    delay_line.push_silence(delay_line.get_size());
    EXPECT_TRUE(delay_line.is_silent());
    delay_line.push_silence(std::int64_t{1} << 50);  // free, or this would never end
    EXPECT_EQ(delay_line.get_position(), static_cast<std::int64_t>(all.size()) + delay_line.get_size() + (std::int64_t{1} << 50));
  }
}

}  // namespace
}  // namespace carillon::synth
