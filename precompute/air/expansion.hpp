// Multipole expansion of the field of a surface.
#pragma once

#include <complex>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "precompute/air/surface.hpp"

namespace carillon::air {

inline constexpr std::size_t count_harmonics(int order) {
  return static_cast<std::size_t>(order + 1) * static_cast<std::size_t>(order + 1);
}

/// Coefficients c_lm, l <= order, of n fields about the centre of the sphere, (n, (order + 1)^2), from pressure and velocity on the
/// surface. With dp/dn = v:
///   c_lm = i k integral of [ p dn(j_l(kr) Y_lm) - v j_l(kr) Y_lm ] dS,      p = sum c_lm h_l(kr) Y_lm outside the sphere.
/// `pressure`: (N, n) at the nodes; `velocity`: (T, 3, count) at the corners of the facets; `sides`: the n velocities. Midpoint rule.
std::vector<std::complex<double>> calc_expansion(const RadiatingSurface& surface, const Sphere& sphere, double k, int order,
                                                 std::span<const std::complex<float>> pressure, std::span<const float> velocity,
                                                 std::size_t count, std::span<const std::int32_t> sides);

/// Spherical Bessel functions j_0 .. j_order of x >= 0, error 1e-13 relative or 1e-290 absolute.
std::vector<double> calc_bessel(double x, int order);

/// log |h_l(x)| of the spherical Hankel functions of x > 0, l = 0 .. order.
std::vector<double> calc_log_hankel(double x, int order);
/// Phase h_l / |h_l|.
std::vector<std::complex<double>> calc_hankel_phase(double x, int order);

/// Squared weights of a coefficient c_lm |h_l(k R)| at the distance `nearest_m` and in the far field, the latter relative to order 0.
struct Spread {
  std::vector<double> near, far;  // (order + 1)
};
Spread calc_spread(double k, double radius_m, double nearest_m, int order);

}  // namespace carillon::air
