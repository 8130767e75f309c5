// Roots of functions with known roots.
#include "runtime/base/crossing.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace carillon::base {
namespace {

TEST(Crossing, IsFoundForSteepAndFlatFunctions) {
  for (const double power : {0.2, 1.0, 3.0}) {
    int values = 0;
    const auto calc = [&](double x) { return ++values, std::copysign(std::pow(std::abs(x - 0.3), power), x - 0.3); };
    const double root = find_crossing(calc, 0.0, -std::pow(0.3, power), 1.0, std::pow(0.7, power), 0.0, 1e-9, 200);
    EXPECT_NEAR(root, 0.3, 1e-9) << power;
    EXPECT_LT(values, 200) << power;
  }
}

TEST(Crossing, StopsAtToleranceAndLimit) {
  int values = 0;
  const auto calc = [&](double x) { return ++values, x * x - 2.0; };
  const double root = find_crossing(calc, 0.0, -2.0, 2.0, 2.0, 1e-6, 0.0, 50);
  EXPECT_LE(std::abs(root * root - 2.0), 1e-6);
  EXPECT_LT(values, 12);
  values = 0;
  const double early = find_crossing(calc, 0.0, -2.0, 2.0, 2.0, 0.0, 0.0, 3);
  EXPECT_EQ(values, 3);
  EXPECT_NEAR(early, std::sqrt(2.0), 0.1);
  // From either end.
  EXPECT_NEAR(find_crossing(calc, 2.0, 2.0, 0.0, -2.0, 1e-12, 0.0, 50), std::sqrt(2.0), 1e-12);
}

}  // namespace
}  // namespace carillon::base
