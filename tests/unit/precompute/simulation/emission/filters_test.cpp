// Low-pass from steps to samples, delay and DC blocker, by single tones.
#include <gtest/gtest.h>

#include <cmath>
#include <complex>
#include <vector>

#include "precompute/simulation/emission/weights.hpp"
#include "runtime/acoustics/recording/high_pass.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/instruction_sets.hpp"
#include "tests/unit/precompute/simulation/emission/motions.hpp"

namespace carillon::emission {
namespace {

using namespace testing;
using recording::calc_alpha;
using recording::HighPass;

/// Received tone of a small pulsating sphere, over rho Q' / (4 pi r) of the same velocity at the frequency `reference_hz`.
double find_gain(double freq_hz, double reference_hz, int steps, double r = 0.5) {
  const double radius = 1e-4, omega = kTwoPi * freq_hz, speed = 1e-3;
  const Options options = make_options(1200, {0.0, 0.0, r}, steps);
  const air::testing::Skin skin = air::testing::make_ball(2, radius);
  const auto sound = hear_shape(
      make_part(skin), options, [](const Vec3& x) { return normalise(x); }, [&](double t) { return speed / omega * std::sin(omega * t); });
  double area = 0.0;  // derivative of the polyhedron's volume
  for (const Triangle& t : skin.triangles) {
    const Vec3 twice = cross(skin.nodes_m[t[1]] - skin.nodes_m[t[0]], skin.nodes_m[t[2]] - skin.nodes_m[t[0]]);
    for (const std::int32_t node : t) area += dot(normalise(skin.nodes_m[node]), twice) / 6.0;
  }
  const double heard = std::abs(find_amplitude(sound, reference_hz, options.sample_rate_hz, 236, 1196));
  return heard / (kRho * kTwoPi * reference_hz * speed * area / (kTwoPi * 2.0 * r));
}

TEST(LowPass, PulsatingSphere) {
  tests::for_each_instruction_set([&] {
    for (const double freq_hz : {100.0, 1000.0, 5000.0, 10000.0, 15000.0})
      EXPECT_NEAR(find_gain(freq_hz, freq_hz, 16), 1.0, 1.2e-3) << freq_hz << " Hz";  // ka = 0.03 at 15 kHz
    for (const double freq_hz : {1000.0, 5000.0}) EXPECT_NEAR(find_gain(freq_hz, freq_hz, 64), 1.0, 1e-3) << freq_hz << " Hz, 64 steps";
  });
}

TEST(LowPass, PassBandTo20kHz) {
  for (const int steps : {4, 16, 20, 68, 112})
    for (const double freq_hz : {50.0, 8000.0, 16000.0, 19200.0, 20000.0})
      EXPECT_NEAR(to_db(find_gain(freq_hz, freq_hz, steps)), 0.0, 0.1) << freq_hz << " Hz, " << steps << " steps";
}

TEST(LowPass, DelayFlatness) {
  for (const double part : {0.0, 0.25, 0.5, 0.77}) {
    const double r = (100.0 + part) * kC / 48000.0;
    for (const double freq_hz : {1000.0, 10000.0, 19200.0})
      EXPECT_NEAR(to_db(find_gain(freq_hz, freq_hz, 16, r)), 0.0, 0.05) << part << ", " << freq_hz;
  }
}

TEST(LowPass, AliasRejection) {
  // Aliases at f - 48 kHz and so on; at 16 * 48 kHz - f and 32 * 48 kHz - f the box averages attenuate them.
  for (const int steps : {16, 112})
    for (const double low_hz : {1000.0, 9000.0, 19000.0, 19900.0})
      for (const double image_hz : {48e3, 96e3, 144e3, 192e3, 384e3, 768e3}) {
        if (image_hz + low_hz > 0.5 * 48e3 * steps) continue;
        for (const double sign : {-1.0, 1.0})
          EXPECT_LT(to_db(find_gain(image_hz + sign * low_hz, low_hz, steps)), -60.0)
              << image_hz << " " << sign * low_hz << ", " << steps << " steps";
      }
}

TEST(LowPass, StepRounding) {
  EXPECT_EQ(find_steps(1), 4);
  EXPECT_EQ(find_steps(64), 64);
  EXPECT_EQ(find_steps(101), 104);
  EXPECT_EQ(find_steps(208), 208);
  for (int least = 1; least < 3000; ++least) {
    const int steps = find_steps(least);
    EXPECT_GE(steps, least);
    EXPECT_LE(steps, std::max(least + 3, static_cast<int>(1.07 * least)));
    EXPECT_EQ(steps % 4, 0);
  }
}

double find_blocker_gain(double freq_hz, double alpha, double rate_hz) {
  HighPass blocker;
  std::vector<double> out;
  for (int n = 0; n < 60000; ++n) out.push_back(blocker.next(std::sin(kTwoPi * freq_hz * n / rate_hz), alpha));
  return std::abs(find_amplitude(out, freq_hz, rate_hz, 20000, 60000));
}

TEST(HighPass, CornerFrequency) {
  const double half_power_db = to_db(std::sqrt(0.5));
  for (const double corner_hz : {20.0, 100.0, 400.0}) {
    const double alpha = calc_alpha(corner_hz, 48000.0), top = 2.0 / (2.0 - alpha);
    EXPECT_NEAR(to_db(find_blocker_gain(corner_hz, alpha, 48000.0) / top), half_power_db, 0.02) << corner_hz;
    EXPECT_NEAR(find_blocker_gain(23000.0, alpha, 48000.0) / top, 1.0, 1e-4);
  }
  EXPECT_NEAR(to_db(find_blocker_gain(738.0, kAlpha2001, 44100.0) * 0.95), half_power_db, 0.02);
  EXPECT_LT(find_blocker_gain(1.0, calc_alpha(20.0, 48000.0), 48000.0), 0.051);
}

TEST(LowPass, CombinedResponse) {
  const MotionWeights weights = make_motion_weights();
  constexpr int kSteps = 64;  // a half-sample
  const auto find_response = [&](double rate, bool is_velocity) {
    double entry = 0.0, whole = 0.0;
    for (int i = -2 * kSteps; i <= 2 * kSteps; ++i) {
      const double x = static_cast<double>(i) / kSteps;
      entry += calc_entry(x) * std::cos(0.5 * kTwoPi * rate * x);
      whole += calc_entry(x);
    }
    double sum = is_velocity ? 0.0 : weights.even[0];
    for (int j = 1; j <= kMotionHalf; ++j) {
      const double turn = 0.5 * kTwoPi * rate * j;
      const std::size_t at = j;
      sum += is_velocity ? 2.0 * weights.odd[at] * std::sin(turn) / (kTwoPi * rate) : 2.0 * weights.even[at] * std::cos(turn);
    }
    return entry / whole * sum;
  };
  for (const bool is_velocity : {false, true}) {
    for (double rate = 0.002; rate <= 5.0 / 12.0; rate += 0.002)
      EXPECT_NEAR(to_db(find_response(rate, is_velocity)), 0.0, 0.01) << rate << " " << is_velocity;
    for (double rate = 7.0 / 12.0; rate < 8.0; rate += 0.0037)
      if (std::abs(rate - std::round(rate)) <= 5.0 / 12.0) {
        EXPECT_LT(to_db(std::abs(find_response(rate, is_velocity))), -60.0) << rate << " " << is_velocity;
      }
  }
}

TEST(Derivative, OfATone) {
  const auto weights = make_derivative();
  for (int i = 1; i <= 420; ++i) {
    const double omega = kTwoPi * 1e-3 * i;
    double derivative = 0.0;
    for (int j = 1; j <= kDerivativeHalf; ++j) derivative += 2.0 * weights[j] * std::sin(j * omega);
    EXPECT_NEAR(derivative / omega, 1.0, 5e-4) << i;
  }
}

TEST(HighPass, ConstantInput) {
  HighPass blocker;
  for (int n = 0; n < 10; ++n) EXPECT_EQ(blocker.next(7.0, 0.1), 0.0);
}

}  // namespace
}  // namespace carillon::emission
