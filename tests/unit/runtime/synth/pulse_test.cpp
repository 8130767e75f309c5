#include "runtime/synth/pulse.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "tests/unit/runtime/synth/quadrature.hpp"

namespace carillon::synth {
namespace {

TEST(Pulse, HasUnitAreaAndItsShape) {
  for (const double x : {0.001, 0.1, 0.33, 0.5, 0.9, 0.999})
    EXPECT_NEAR(calc_pulse(PulseShape::kHertz, x), testing::calc_reference_pulse(x), 1e-12);
  EXPECT_EQ(calc_pulse(PulseShape::kHertz, 0.0), 0.0);
  EXPECT_EQ(calc_pulse(PulseShape::kHertz, 1.0), 0.0);
  EXPECT_EQ(calc_pulse(PulseShape::kHertz, -3.0), 0.0);
  EXPECT_NEAR(testing::integrate([](double x) { return calc_pulse(PulseShape::kHertz, x); }, 0.0, 1.0), 1.0, 1e-12);
}

TEST(Pulse, MomentsMatchQuadratureWhereverThePulseLies) {
  for (const double duration : {0.05, 0.7, 1.0, 2.3, 17.0, 480.0}) {
    for (const double start : {-0.99 * duration, -0.5 * duration, -0.1 * duration, -0.3, 0.0, 0.001, 0.37, 0.9}) {
      const double from = std::max(0.0, start);
      const double to = std::min(1.0, start + duration);
      if (to <= from) continue;
      const Moments moments = calc_pulse_moments(PulseShape::kHertz, start, duration);
      for (const int j : {0, 1, 2, 5, 11}) {
        const double expected = testing::integrate(
            [&](double u) {
              return testing::calc_reference_pulse((u - start) / duration) / duration * std::cos(j * std::acos(2.0 * u - 1.0));
            },
            from, to);
        EXPECT_NEAR(moments[j], expected, 2e-10) << "duration " << duration << " start " << start << " moment " << j;
      }
    }
  }
}

// Standard deviation of sin(pi x)^1.5 as a distribution over 0..1.
double calc_reference_deviation() {
  return std::sqrt(testing::integrate([](double x) { return testing::calc_reference_pulse(x) * (x - 0.5) * (x - 0.5); }, 0.0, 1.0));
}

TEST(Pulse, TheGaussianHasTheAreaTheMiddleAndTheVarianceOfTheHertzPulse) {
  const double tau = 3.0, length = calc_pulse_length(PulseShape::kGaussian, tau);
  EXPECT_EQ(calc_pulse_length(PulseShape::kHertz, tau), tau);
  const auto moment = [&](int power) {
    return testing::integrate([&](double x) { return calc_pulse(PulseShape::kGaussian, x) * std::pow((x - 0.5) * length, power); }, 0.0,
                              1.0);
  };
  EXPECT_NEAR(moment(0), 1.0, 1e-12);
  EXPECT_NEAR(moment(1), 0.0, 1e-12);
  EXPECT_NEAR(std::sqrt(moment(2)), calc_reference_deviation() * tau, 1e-3 * tau);  // up to the cut
  EXPECT_NEAR(length, 8.0 * calc_reference_deviation() * tau, 1e-9);
}

TEST(Pulse, TheHertzPulseIs3And20DbDownWhereItShould) {
  const auto calc_level_db = [](double cycles) {
    const double at = 2.0 * std::numbers::pi * cycles;
    return 20.0 *
           std::log10(testing::integrate([=](double x) { return calc_pulse(PulseShape::kHertz, x) * std::cos(at * (x - 0.5)); }, 0.0, 1.0));
  };
  EXPECT_NEAR(calc_level_db(0.66), -3.0, 0.1);
  EXPECT_NEAR(calc_level_db(1.48), -20.0, 0.3);
}

TEST(Pulse, TheGaussiansSpectrumIsGaussian) {
  for (const double omega_tau : {0.5, 3.0, 10.0, 20.0}) {
    const double length = calc_pulse_length(PulseShape::kGaussian, 1.0);
    const double spectrum = testing::integrate(
        [&](double x) { return calc_pulse(PulseShape::kGaussian, x) * std::cos(omega_tau * length * (x - 0.5)); }, 0.0, 1.0);
    const double s = omega_tau * calc_reference_deviation();
    EXPECT_NEAR(spectrum, std::exp(-0.5 * s * s), 2.0 * std::erfc(4.0 / std::sqrt(2.0))) << omega_tau;  // twice the area beyond the cut
  }
}

TEST(Pulse, MomentsOfTheGaussianMatchQuadrature) {
  const double deviation = calc_reference_deviation();
  for (const double duration : {0.05, 0.7, 1.0, 2.3, 17.0, 480.0}) {
    const double length = calc_pulse_length(PulseShape::kGaussian, duration);
    const double area = std::erf(4.0 / std::sqrt(2.0));
    for (const double start : {-0.99 * length, -0.5 * length, -0.1 * length, -0.3, 0.0, 0.001, 0.37, 0.9}) {
      const double from = std::max(0.0, start), to = std::min(1.0, start + length);
      if (to <= from) continue;
      const Moments moments = calc_pulse_moments(PulseShape::kGaussian, start, length);
      for (const int j : {0, 1, 2, 5, 9}) {
        const double expected = testing::integrate(
            [&](double u) {
              const double y = (u - start - 0.5 * length) / (deviation * duration);
              return std::exp(-0.5 * y * y) / (deviation * duration * std::sqrt(2.0 * std::numbers::pi) * area) *
                     std::cos(j * std::acos(2.0 * u - 1.0));
            },
            from, to);
        EXPECT_NEAR(moments[j], expected, 1e-8) << "duration " << duration << " start " << start << " moment " << j;
      }
    }
  }
}

TEST(Pulse, MomentsOfALongPulseMatchQuadratureInEverySample) {
  for (const double duration : {16.5, 48.0, 97.3}) {
    for (int n = 0; n < static_cast<int>(duration) + 1; ++n) {
      const double start = 0.37 - n;
      const Moments moments = calc_pulse_moments(PulseShape::kHertz, start, duration);
      for (const int j : {0, 3, 9}) {
        const double expected = testing::integrate(
            [&](double u) {
              return testing::calc_reference_pulse((u - start) / duration) / duration * std::cos(j * std::acos(2.0 * u - 1.0));
            },
            std::max(0.0, start), std::min(1.0, start + duration));
        ASSERT_NEAR(moments[j], expected, 2e-10) << "duration " << duration << " sample " << n << " moment " << j;
      }
    }
  }
}

TEST(Pulse, MomentsOfAllIntervalsSumToTheArea) {
  double sum = 0.0;
  for (int n = 0; n < 40; ++n) sum += calc_pulse_moments(PulseShape::kHertz, 3.21 - n, 33.3)[0];
  EXPECT_NEAR(sum, 1.0, 1e-13);
}

TEST(Pulse, AnImpulseIsCountedInExactlyOneInterval) {
  EXPECT_EQ(calc_pulse_moments(PulseShape::kHertz, 0.0, 0.0)[0], 0.0);
  EXPECT_EQ(calc_pulse_moments(PulseShape::kHertz, 1e-15, 0.0)[0], 1.0);
  EXPECT_EQ(calc_pulse_moments(PulseShape::kHertz, 1.0, 0.0)[0], 1.0);
  EXPECT_EQ(calc_pulse_moments(PulseShape::kHertz, 1.0 + 1e-15, 0.0)[0], 0.0);
}

TEST(Pulse, ChebyshevSeriesHoldsARotationUpToNyquist) {
  const double angle = std::numbers::pi;
  std::array<double, kMoments> values{};
  const auto points = get_chebyshev_points();
  for (int k = 0; k < kMoments; ++k) values[k] = std::cos(angle * points[k]);
  const Moments coefficients = calc_chebyshev_coefficients(values);
  for (double u = 0.0; u <= 1.0; u += 0.01) {
    const Moments t = calc_chebyshev(u);
    double sum = 0.0;
    for (int j = 0; j < kMoments; ++j) sum += coefficients[j] * t[j];
    EXPECT_NEAR(sum, std::cos(angle * u), 1e-9);
  }
}

/// A constant force, by a sum over a hundred thousand points.
TEST(LevelMoments, AreThoseOfTheirPart) {
  for (const auto& [start, length] :
       {std::array{0.2, 0.3}, std::array{-0.7, 1.1}, std::array{0.9, 5.0}, std::array{-3.0, 7.0}, std::array{0.5, 1e-3}}) {
    Moments expected{};
    constexpr int kPoints = 100000;
    const double from = std::clamp(start, 0.0, 1.0), to = std::clamp(start + length, 0.0, 1.0);
    for (int i = 0; i < kPoints; ++i) {
      const Moments t = calc_chebyshev(from + (to - from) * (i + 0.5) / kPoints);
      for (std::size_t j = 0; j < t.size(); ++j) expected[j] += t[j] * (to - from) / kPoints / length;
    }
    const Moments moments = calc_level_moments(start, length);
    for (std::size_t j = 0; j < moments.size(); ++j) EXPECT_NEAR(moments[j], expected[j], 1e-8) << start << " " << length << " " << j;
  }
  EXPECT_EQ(calc_level_moments(1.0, 2.0), Moments{});
  EXPECT_EQ(calc_level_moments(-2.0, 2.0), Moments{});
  EXPECT_NEAR(calc_level_moments(0.4, kShortestStep)[0], 1.0, 1e-9);
}

}  // namespace
}  // namespace carillon::synth
