// Paths of driven nodes: through the rows, and smooth. Oracle: differences.
#include "precompute/simulation/transient/path.hpp"

#include <gtest/gtest.h>

#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"

namespace carillon::transient {
namespace {

TEST(Path, interpolation_and_rest) {
  const Path path({{0.1, {0, 0, 0}}, {0.2, {1, 0, 2}}, {0.5, {-1, 3, 2}}, {0.6, {0, 1, 0}}});
  EXPECT_EQ(norm(path.calc(0.0)), 0.0);
  EXPECT_LT(norm(path.calc(0.2) - Vec3{1, 0, 2}), 1e-14);
  EXPECT_LT(norm(path.calc(0.5) - Vec3{-1, 3, 2}), 1e-14);
  EXPECT_EQ(path.calc(0.7), (Vec3{0, 1, 0}));
  EXPECT_EQ(norm(Path().calc(0.3)), 0.0);
}

TEST(Path, continuity) {
  const Path path({{0.1, {0, 0, 0}}, {0.2, {1, 0, 2}}, {0.5, {-1, 3, 2}}, {0.6, {0, 1, 0}}});
  const double h = 1e-5;
  const auto slope = [&](double a, double b) { return (1.0 / (b - a)) * (path.calc(b) - path.calc(a)); };
  for (const double t : {0.1, 0.2, 0.5, 0.6}) {
    // Second differences of the two sides: they meet as h goes to 0, with an error of h times the jump of the third derivative.
    const Vec3 before = (1.0 / h) * (slope(t - h, t) - slope(t - 2 * h, t - h)),
               after = (1.0 / h) * (slope(t + h, t + 2 * h) - slope(t, t + h));
    EXPECT_LT(norm(after - before), 5.0) << t;  // of accelerations up to some 1,000
    EXPECT_LT(norm(slope(t, t + h) - slope(t - h, t)), 0.02) << t;
  }
}

TEST(Path, minimum_jerk) {
  const Path path({{0.0, {0, 0, 0}}, {0.5, {0, 0, -0.03}}});
  const double x = 0.3;
  EXPECT_NEAR(path.calc(0.15)[2], -0.03 * (10 * x * x * x - 15 * x * x * x * x + 6 * x * x * x * x * x), 1e-16);
}

TEST(Path, invalid_rows) {
  EXPECT_EQ(tests::catch_message<InputError>([] {
              Path({{0.0, {0, 0, 0}}, {0.0, {1, 0, 0}}});
            }),
            "path of driven nodes: the time 0 s of row 2 is not after 0 s of the row before; sort the rows by time");
  EXPECT_THROW(Path({{0.0, {0, 0, 1}}, {1.0, {0, 0, 1}}}), InputError);
  EXPECT_THROW(Path({{0.0, {0, 0, 0}}, {1.0, {0, std::nan(""), 0}}}), InputError);
}

}  // namespace
}  // namespace carillon::transient
