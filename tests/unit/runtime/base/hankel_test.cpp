#include "runtime/base/hankel.hpp"

#include <gtest/gtest.h>

#include <cmath>

namespace carillon::base {
namespace {

using Complex = std::complex<double>;

Complex calc_hankel(int order, double x) {
  const auto l = static_cast<unsigned>(order);
  return {std::sph_bessel(l, x), std::sph_neumann(l, x)};
}

TEST(HankelQuotients, MatchTheStandardLibrary) {
  for (const double x : {0.3, 1.0, 4.0, 20.0, 60.0}) {
    const auto quotients = calc_hankel_quotients(x, 40);
    ASSERT_EQ(quotients.size(), 41U);
    EXPECT_EQ(quotients[0], Complex(0.0, 1.0));
    for (int l = 1; l <= 40; ++l) {
      const Complex wanted = calc_hankel(l - 1, x) / calc_hankel(l, x);
      if (!std::isfinite(std::abs(wanted))) continue;
      EXPECT_LT(std::abs(quotients[l] - wanted), 1e-12 * std::abs(wanted)) << l << " at " << x;
    }
  }
}

// W(j, y) = 1 / x^2 (DLMF 10.50.1) is Im(h_{l-1} / h_l) |h_l|^2: tests sizes and phases.
TEST(HankelQuotients, KeepTheWronskian) {
  for (const double x : {1e-3, 0.1, 2.0, 37.0, 300.0}) {
    double square = 1.0 / (x * x);  // |h_l|^2
    const auto quotients = calc_hankel_quotients(x, 120);
    for (std::size_t l = 1; l < quotients.size(); ++l) {
      square /= std::norm(quotients[l]);
      if (!(square < 1e200)) break;
      const double found = quotients[l].imag() * square * x * x;
      if (std::abs(quotients[l].imag()) > 1e-6 * std::abs(quotients[l])) {
        EXPECT_NEAR(found, 1.0, 1e-8) << l << " at " << x;
      }
    }
  }
}

TEST(HankelQuotients, AreFiniteWhereTheFunctionsOverflow) {
  for (const Complex& quotient : calc_hankel_quotients(1e-6, 120)) EXPECT_TRUE(std::isfinite(std::abs(quotient)));
}

}  // namespace
}  // namespace carillon::base
