// Spherical Hankel functions, by the quotients of neighbours, which neither overflow nor lose digits.
#pragma once

#include <complex>
#include <cstddef>
#include <vector>

namespace carillon::base {

/// h_{l-1}(x) / h_l(x) of h_l = j_l + i y_l for l = 0 .. order, (order + 1); h_{-1} / h_0 = i. 0 < x, 0 <= order. Those of the second
/// kind, j_l - i y_l, are their complex conjugates. By 1 / u_{l+1} = (2 l + 1) / x - u_l upwards, which is stable for h as |h_l| grows:
/// DLMF 10.51.1. With |h_0| = 1 / x every size follows, with h_l' = h_{l-1} - (l + 1) / x h_l every slope (DLMF 10.51.2).
inline std::vector<std::complex<double>> calc_hankel_quotients(double x, int order) {
  std::vector<std::complex<double>> quotients{{0.0, 1.0}};
  quotients.reserve(order + 1);
  for (int l = 0; l < order; ++l) quotients.push_back(1.0 / ((2.0 * l + 1.0) / x - quotients.back()));
  return quotients;
}

}  // namespace carillon::base
