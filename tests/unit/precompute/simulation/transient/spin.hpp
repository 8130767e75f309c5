// A free body that turns: what must not change.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

#include "tests/unit/precompute/simulation/transient/bodies.hpp"

namespace carillon::transient::testing {

/// Relative errors, over all of the run.
struct Turned {
  double step_s = 0.0, book_error = 0.0, stretch = 0.0;  // stretch: most elastic energy over the kinetic energy at the start
  double angular_error = 0.0, linear_error = 0.0;
};

/// Fifteen turns of a free box of soft plastic, fast enough that it stretches.
inline Turned turn_fifteen_times(int order) {
  const double omega = 2000.0;
  World world({{"body", make_box({0.06, 0.02, 0.02}, {3, 1, 1}, order), make_law(1e9, 0.3, 1100), 0.0}});
  MotionOptions options;
  options.sample_rate_hz = 50000;
  options.longest_step_s = 5e-7;
  Motion motion(world.domain, options);
  motion.set_start([&](std::int32_t, const Vec3& x) { return Motion::Start{{}, Vec3{-omega * x[1], omega * x[0], 1.5}}; });
  const Motion::Momentum before = motion.calc_momentum();
  const EnergyBook start = motion.calc_book();
  Turned turned{motion.get_step_s()};
  while (motion.get_time_s() < 15 * 2 * std::numbers::pi / omega) {
    for (int i = 0; i < 100; ++i) motion.advance_sample();
    const EnergyBook book = motion.calc_book();
    turned.book_error = std::max(turned.book_error, std::abs(book.relative_error));
    turned.stretch = std::max(turned.stretch, book.elastic_j / start.kinetic_j);
  }
  const Motion::Momentum after = motion.calc_momentum();
  turned.angular_error = norm(after.angular - before.angular) / norm(before.angular);
  turned.linear_error = norm(after.linear - before.linear) / norm(before.linear);
  return turned;
}

}  // namespace carillon::transient::testing
