// Springs: forces of a step against quadrature, loss, length of pulses.
#include "runtime/physics/impact/spring.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace carillon::impact {
namespace {

TEST(Spring, MeanForceAndSlopeOfStep) {
  for (const double p : {1.0, 1.5, 2.3, 3.5}) {
    const Spring spring{2e7, p, 0.0};
    for (const auto& [y0, y1] : std::to_array<std::array<double, 2>>({{0, 1e-5},
                                                                      {1e-5, 0},
                                                                      {2e-6, 9e-6},
                                                                      {9e-6, 2e-6},
                                                                      {-3e-6, 4e-6},
                                                                      {4e-6, -3e-6},
                                                                      {5e-6, 5.05e-6},
                                                                      {5e-6, 5e-6 + 1e-15},
                                                                      {5e-6, 5e-6}})) {
      long double sum = 0.0L;
      constexpr int kPoints = 20000;
      for (int i = 0; i < kPoints; ++i) {
        const long double y = y0 + (y1 - y0) * (i + 0.5L) / kPoints;
        if (y > 0) sum += 2e7L * std::pow(y, static_cast<long double>(p));
      }
      const auto mean = static_cast<double>(sum / kPoints);
      const StepForce force = calc_step_force(spring, y0, y1, 1e-6);
      EXPECT_NEAR(force.force, mean, 1e-6 * mean) << p << " " << y0 << " " << y1;
      const double d = 1e-9,
                   slope = (calc_step_force(spring, y0, y1 + d, 1e-6).force - calc_step_force(spring, y0, y1 - d, 1e-6).force) / (2 * d);
      EXPECT_NEAR(force.slope, slope, 2e-3 * slope + 1e-9);
      // The work of the force is the difference of the energies.
      const double work = force.force * (y1 - y0), energy = calc_spring_energy(spring, y1) - calc_spring_energy(spring, y0);
      EXPECT_NEAR(work, energy, 1e-15 * calc_spring_energy(spring, 1e-5));
    }
  }
  EXPECT_EQ(calc_step_force({2e7, 1.5, 0.0}, -1e-5, -1e-6, 1e-6).force, 0.0);
}

TEST(Spring, HysteresisOfHuntAndCrossley) {
  // chi v and e from the equation of motion by Runge-Kutta, step 2e-5.
  for (const auto& [x, e] : std::to_array<std::array<double, 2>>({{0.02, .986842},
                                                                  {0.05, .967739},
                                                                  {0.1, .937476},
                                                                  {0.2, .882190},
                                                                  {0.3, .832870},
                                                                  {0.5, .748435},
                                                                  {0.7, .678595},
                                                                  {1.0, .593624},
                                                                  {2.0, .410720},
                                                                  {3.0, .306897},
                                                                  {5.0, .196980},
                                                                  {10.0, .099982}}))
    EXPECT_NEAR(calc_hysteresis(e, 2.0) * 2.0, x, 1e-4 * x);
  EXPECT_EQ(calc_hysteresis(1.0, 1.0), 0.0);
  EXPECT_GT(calc_hysteresis(0.0, 1.0), 100.0);
  double last = 0.0;
  for (double e = 1.0; e >= 0.0; e -= 1e-3) {  // smooth down from 1, no noise of cancellation
    const double chi = calc_hysteresis(e, 1.0);
    EXPECT_GE(chi, last) << e;
    last = chi;
  }
}

TEST(Spring, PulseDuration) {
  const Spring hertz{1e10, 1.5, 0.0};
  EXPECT_NEAR(calc_elastic_pulse(hertz, 0.1, 2.0).length_s, 3.21807 * std::pow(0.1 / (1e10 * std::sqrt(2.0)), 0.4), 1e-9);
  const Spring linear{1e6, 1.0, 0.0};
  EXPECT_NEAR(calc_elastic_pulse(linear, 0.1, 2.0).length_s, M_PI * std::sqrt(0.1 / 1e6), 1e-12);
  EXPECT_NEAR(calc_elastic_pulse(linear, 0.1, 2.0).compression_m, 2.0 * std::sqrt(0.1 / 1e6), 1e-12);
}

}  // namespace
}  // namespace carillon::impact
