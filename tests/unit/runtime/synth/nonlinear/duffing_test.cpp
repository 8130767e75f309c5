// One mode: Duffing's oscillator, whose frequency is known exactly.
#include <gtest/gtest.h>

#include "tests/unit/runtime/synth/nonlinear/bodies.hpp"

namespace carillon::nonlinear {
namespace {

using bodies::Body;

double measure_cents(double hz, double alpha, Integrator integrator, double amplitude = 1e-3) {
  constexpr double kRateHz = 48000.0;
  const Body body = bodies::make_duffing(hz, alpha * bodies::to_eigenvalue(hz) / (amplitude * amplitude));
  CoupledModes modes(body.energy, body.modes, kRateHz, {.integrator = integrator});
  modes.set_state(0, amplitude, 0.0);
  return 1200.0 * std::log2(bodies::measure_hz(modes, 0, kRateHz, 96000) / (hz * bodies::calc_duffing_ratio(alpha)));
}

TEST(EllipticIntegral, IsThatOfTheTables) {
  EXPECT_NEAR(bodies::calc_duffing_ratio(1.31625), 1.4023561228707, 1e-12);
  EXPECT_NEAR(bodies::calc_duffing_ratio(0.3), 1.10601823825973, 1e-12);
  EXPECT_NEAR(bodies::calc_duffing_ratio(100.0), 8.53358618899868, 1e-11);
}

TEST(Duffing, HasItsFrequencyToATenthOfACentAt100Hz) {
  for (const double alpha : {0.01, 0.3, 1.31625, 3.0}) EXPECT_NEAR(measure_cents(100.0, alpha, Integrator::kGuarded), 0.0, 0.1) << alpha;
}

TEST(Duffing, HasItsFrequencyToHalfACentAt1KHzAndThicknessAmplitude) {
  EXPECT_NEAR(measure_cents(1000.0, 1.31625, Integrator::kGuarded), 0.0, 0.5);
}

TEST(Duffing, ByTheAuxiliaryVariableIsWithinSixCents) {
  EXPECT_NEAR(measure_cents(1000.0, 1.31625, Integrator::kAuxiliary), 0.0, 6.0);
  EXPECT_NEAR(measure_cents(100.0, 1.31625, Integrator::kAuxiliary), 0.0, 0.1);
}

TEST(Duffing, DoesNotDependOnTheUnitsOfItsAmplitude) {
  EXPECT_NEAR(measure_cents(1000.0, 1.31625, Integrator::kGuarded, 1e-9), measure_cents(1000.0, 1.31625, Integrator::kGuarded, 1e3), 1e-4);
}

}  // namespace
}  // namespace carillon::nonlinear
