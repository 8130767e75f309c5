// Sums of any order have the same bits, and are exact. Oracle: sums that are known.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>

#include "precompute/simulation/transient/order_free_sum.hpp"

namespace carillon::transient {
namespace {

double sum_of(const std::vector<double>& values) {
  OrderFreeSum sum;
  for (const double value : values) sum.add(value);
  return sum.calc();
}

TEST(OrderFreeSum, cancellation) {
  EXPECT_EQ(sum_of({1e300, 1.0, -1e300}), 1.0);
  EXPECT_EQ(sum_of({1e16, 1.0, 1.0, -1e16}), 2.0);
  EXPECT_EQ(sum_of({-3.5, 1.25}), -2.25);
  EXPECT_EQ(sum_of({5e-324, 5e-324}), 1e-323);
  EXPECT_EQ(sum_of({0.0, -0.0}), 0.0);
  EXPECT_EQ(sum_of({std::numeric_limits<double>::max(), -1.0}), std::numeric_limits<double>::max());
}

TEST(OrderFreeSum, order_independence) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> mantissa(-1.0, 1.0);
  std::uniform_int_distribution<int> exponent(-80, 80);
  std::vector<double> values;
  long double all = 0.0L;
  for (int i = 0; i < 20000; ++i) values.push_back(std::ldexp(mantissa(random), exponent(random)));
  for (const double value : values) all += static_cast<long double>(value);
  const double first = sum_of(values);
  EXPECT_NEAR(first / static_cast<double>(all), 1.0, 1e-15);
  for (int i = 0; i < 5; ++i) {
    std::shuffle(values.begin(), values.end(), random);
    EXPECT_EQ(sum_of(values), first);
  }
}

TEST(OrderFreeSum, nonfinite_values) {
  EXPECT_TRUE(std::isnan(sum_of({1.0, std::numeric_limits<double>::infinity()})));
  EXPECT_TRUE(std::isnan(sum_of({std::nan(""), 2.0})));
}

}  // namespace
}  // namespace carillon::transient
