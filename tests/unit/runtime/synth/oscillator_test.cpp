#include "runtime/synth/oscillator.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/runtime/synth/reference.hpp"

namespace carillon::synth {
namespace {

TEST(Oscillator, AnswersAnImpulseLikeTheClosedFormInAllRegimes) {
  const auto rows = testing::read_impulse_reference();
  ASSERT_EQ(rows.size(), 48u);
  for (const auto& row : rows) {
    const OscillatorMap map = calc_oscillator_map(row.lambda, row.decay_per_s(), row.time_s);
    // Rounding of d and lambda alone moves a value that has decayed by e^-n by about n units in the last place.
    const double tolerance = 1e-12 * (1.0 + row.decay_per_s() * row.time_s);
    EXPECT_NEAR(map.qv, row.q, tolerance * std::abs(row.q) + 1e-14 * row.time_s * std::exp(-row.decay_per_s() * row.time_s) + 1e-300)
        << row;
    EXPECT_NEAR(map.vv, row.q_dot, tolerance * std::abs(row.q_dot) + 1e-12 * std::exp(-row.decay_per_s() * row.time_s) + 1e-300) << row;
  }
}

TEST(Oscillator, TwoHalfStepsAreOneStep) {
  for (const double decay : {0.0, 10.0, 6283.0, 6283.185307179586, 6284.0, 20000.0, 1e6}) {
    const double lambda = 6283.185307179586 * 6283.185307179586;
    const OscillatorMap one = calc_oscillator_map(lambda, decay, 2e-4);
    const OscillatorMap half = calc_oscillator_map(lambda, decay, 1e-4);
    EXPECT_NEAR(half.qq * half.qv + half.qv * half.vv, one.qv, 1e-13 * 1e-4) << decay;
    EXPECT_NEAR(half.vq * half.qv + half.vv * half.vv, one.vv, 1e-12) << decay;
    EXPECT_NEAR(half.qq * half.qq + half.qv * half.vq, one.qq, 1e-12) << decay;
  }
}

TEST(Oscillator, NothingJumpsAtCriticalDamping) {
  const double omega = 1000.0;
  const OscillatorMap at = calc_oscillator_map(omega * omega, omega, 1e-3);
  EXPECT_NEAR(at.qv, 1e-3 * std::exp(-1.0), 1e-18);
  for (const double step : {1e-15, 1e-12, 1e-9, 1e-6}) {
    EXPECT_NEAR(calc_oscillator_map(omega * omega, omega * (1.0 + step), 1e-3).qv, at.qv, at.qv * 2.0 * (step + 1e-15));
    EXPECT_NEAR(calc_oscillator_map(omega * omega, omega * (1.0 - step), 1e-3).qv, at.qv, at.qv * 2.0 * (step + 1e-15));
  }
}

}  // namespace
}  // namespace carillon::synth
