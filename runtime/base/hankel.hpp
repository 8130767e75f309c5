// Spherical Hankel functions by ratios of consecutive orders, free of overflow and cancellation.
#pragma once

#include <complex>
#include <vector>

namespace carillon::base {

/// h_{l-1}(x) / h_l(x) for h_l = j_l + i y_l, l = 0 .. order, (order + 1); h_{-1} / h_0 = i. x > 0, order >= 0. Second kind: complex
/// conjugates. Upward recurrence 1 / u_{l+1} = (2 l + 1) / x - u_l, stable as |h_l| grows (DLMF 10.51.1). Magnitudes follow from
/// |h_0| = 1 / x, derivatives from h_l' = h_{l-1} - (l + 1) / x h_l (DLMF 10.51.2).
inline std::vector<std::complex<double>> calc_hankel_quotients(double x, int order) {
  std::vector<std::complex<double>> quotients{{0.0, 1.0}};
  quotients.reserve(order + 1);
  for (int l = 0; l < order; ++l) quotients.push_back(1.0 / ((2.0 * l + 1.0) / x - quotients.back()));
  return quotients;
}

}  // namespace carillon::base
