#include "runtime/synth/pulse.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "tests/synth/quadrature.hpp"

namespace carillon::synth {
namespace {

TEST(Pulse, HasUnitAreaAndItsShape) {
  for (const double x : {0.001, 0.1, 0.33, 0.5, 0.9, 0.999}) EXPECT_NEAR(calc_pulse(x), testing::calc_reference_pulse(x), 1e-12);
  EXPECT_EQ(calc_pulse(0.0), 0.0);
  EXPECT_EQ(calc_pulse(1.0), 0.0);
  EXPECT_EQ(calc_pulse(-3.0), 0.0);
  EXPECT_NEAR(testing::integrate(calc_pulse, 0.0, 1.0), 1.0, 1e-12);
}

TEST(Pulse, MomentsMatchQuadratureWhereverThePulseLies) {
  for (const double duration : {0.05, 0.7, 1.0, 2.3, 17.0, 480.0}) {
    for (const double start : {-0.99 * duration, -0.5 * duration, -0.1 * duration, -0.3, 0.0, 0.001, 0.37, 0.9}) {
      const double from = std::max(0.0, start);
      const double to = std::min(1.0, start + duration);
      if (to <= from) continue;
      const Moments moments = calc_pulse_moments(start, duration);
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

TEST(Pulse, MomentsOfAllIntervalsSumToTheArea) {
  double sum = 0.0;
  for (int n = 0; n < 40; ++n) sum += calc_pulse_moments(3.21 - n, 33.3)[0];
  EXPECT_NEAR(sum, 1.0, 1e-13);
}

TEST(Pulse, AnImpulseIsCountedInExactlyOneInterval) {
  EXPECT_EQ(calc_pulse_moments(0.0, 0.0)[0], 0.0);
  EXPECT_EQ(calc_pulse_moments(1e-15, 0.0)[0], 1.0);
  EXPECT_EQ(calc_pulse_moments(1.0, 0.0)[0], 1.0);
  EXPECT_EQ(calc_pulse_moments(1.0 + 1e-15, 0.0)[0], 0.0);
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

}  // namespace
}  // namespace carillon::synth
