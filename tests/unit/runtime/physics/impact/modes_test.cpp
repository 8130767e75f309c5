// Propagators of modes against Runge-Kutta in long double, in all regimes of damping.
#include "runtime/physics/impact/modes.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>

namespace carillon::impact {
namespace {

using Real = long double;
std::array<Real, 2> integrate(Real w, Real d, Real q, Real v, Real f, Real h) {
  const int steps = 400 + static_cast<int>(400 * (w + 2 * d) * h);
  const Real dt = h / steps;
  const auto acceleration = [&](Real x, Real u) { return f - 2 * d * u - w * w * x; };
  for (int i = 0; i < steps; ++i) {
    const Real a1 = acceleration(q, v), q2 = q + dt / 2 * v, v2 = v + dt / 2 * a1, a2 = acceleration(q2, v2), q3 = q + dt / 2 * v2,
               v3 = v + dt / 2 * a2, a3 = acceleration(q3, v3), q4 = q + dt * v3, v4 = v + dt * a3, a4 = acceleration(q4, v4);
    q += dt / 6 * (v + 2 * v2 + 2 * v3 + v4);
    v += dt / 6 * (a1 + 2 * a2 + 2 * a3 + a4);
  }
  return {q, v};
}

TEST(Modes, ExactStepInAllRegimes) {
  const double h = 1e-5;
  for (const double wh : {0.0, 1e-8, 1e-3, 0.3, 0.49, 0.51, 2.0, 3.1415926, 20.0})
    for (const double ratio : {0.0, 1e-4, 0.5, 0.999999, 1.0, 1.000001, 1.3, 4.0}) {
      const double w = wh / h, d = wh == 0.0 ? 3.0 * ratio / h : ratio * w;
      if (d * h > 30) continue;
      const Propagator p = make_propagator(std::array{w}, std::array{d}, h);
      for (const auto& [q, v, f] : std::to_array<std::array<double, 3>>({{1, 0, 0}, {0, 1 / h, 0}, {0, 0, 1 / (h * h)}})) {
        const auto wanted = integrate(w, d, q, v, f, h);
        EXPECT_NEAR(p.a[0] * q + p.b[0] * v + p.g[0] * f, static_cast<double>(wanted[0]), 2e-11) << wh << " " << ratio;
        EXPECT_NEAR(h * (p.c[0] * q + p.e[0] * v + p.b[0] * f), static_cast<double>(h * wanted[1]), 2e-11 * (1 + wh)) << wh << " " << ratio;
      }
    }
}

TEST(Modes, GridOfStepLengths) {
  for (const double h : {1e-9, 3.3e-6, 1.0 / 4096, 0.7}) {
    const int k = find_step(h);
    EXPECT_LE(get_step(k), h);
    EXPECT_GT(get_step(k + 1), h);
  }
  EXPECT_EQ(find_step(get_step(-61)), -61);
}

TEST(Modes, FreeMotionInOneOrManySteps) {
  const Modes modes(std::array{300.0, 4e4, 1e5}, std::array{1.0, 50.0, 2e5});
  std::vector<double> q{1e-3, 2e-5, 1e-6}, v{0.1, 0.2, 0.3}, one = q, one_v = v;
  const double before = modes.calc_energy(q, v);
  modes.move_freely(one, one_v, 0.02);
  for (int i = 0; i < 1000; ++i) modes.move_freely(q, v, 2e-5);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(q[i], one[i], 1e-12);
    EXPECT_NEAR(v[i], one_v[i], 1e-9);
  }
  EXPECT_LT(modes.calc_energy(q, v), before);
}

TEST(Modes, TailOfPlateLikeBodies) {
  std::vector<double> omega, decay, solid, phi;
  for (int i = 1; i <= 100; ++i) {
    omega.push_back(1000.0 * i);
    solid.push_back(1e5 * std::cbrt(i / 100.0));
    decay.push_back(1.0);
    phi.push_back(0.5);
  }
  const Modes plate(omega, decay), body(solid, decay);
  EXPECT_TRUE(plate.has_tail());
  EXPECT_FALSE(body.has_tail());
  EXPECT_EQ(body.calc_tail_compliance(phi), 0.0);
  // Constant density n, equal phi: the tail is phi^2 n / w_c, and its modes have it.
  const double c = plate.calc_tail_compliance(phi);
  EXPECT_NEAR(c, 0.25 / 1000.0 / 1e5, 0.03 * c);
  const auto tail = plate.calc_tail_shapes(c);
  ASSERT_EQ(tail.size(), static_cast<std::size_t>(kTailModes));
  for (const double one : tail) EXPECT_GT(one, 0.0);
  EXPECT_THROW(Modes(std::array{1.0}, std::array<double, 0>{}), std::invalid_argument);
  EXPECT_THROW(Modes(std::array{-1.0}, std::array{0.0}), std::invalid_argument);
}

}  // namespace
}  // namespace carillon::impact
