// Fields with known solutions, and the path from surface velocity to multipoles.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <numeric>
#include <span>
#include <vector>

#include "precompute/air/equations.hpp"
#include "precompute/air/expansion.hpp"
#include "precompute/air/gmres.hpp"
#include "precompute/air/solve.hpp"

namespace carillon::air::testing {

using Complex = std::complex<double>;

inline Complex calc_hankel(int l, double x) {
  return {std::sph_bessel(static_cast<unsigned>(l), x), std::sph_neumann(static_cast<unsigned>(l), x)};
}
inline Complex calc_hankel_slope(int l, double x) { return static_cast<double>(l) / x * calc_hankel(l, x) - calc_hankel(l + 1, x); }

/// Real and orthonormal; cosines for m > 0, sines for m < 0; Y_11 is positive along x.
inline double calc_harmonic(int l, int m, const Vec3& u) {
  const int order = std::abs(m);
  const double polar = std::acos(std::clamp(u[2], -1.0, 1.0)), around = std::atan2(u[1], u[0]);
  const double value = (order % 2 == 1 ? -1.0 : 1.0) * std::sph_legendre(static_cast<unsigned>(l), static_cast<unsigned>(order), polar);
  return m == 0 ? value : std::numbers::sqrt2 * value * (m > 0 ? std::cos(order * around) : std::sin(order * around));
}

/// Directions distributed evenly over a sphere.
inline std::vector<Vec3> spread_directions(int count) {
  std::vector<Vec3> directions;
  for (int i = 0; i < count; ++i) {
    const double z = 1.0 - (2.0 * i + 1.0) / count, angle = 2.0 * std::numbers::pi * i / std::numbers::phi, r = std::sqrt(1.0 - z * z);
    directions.push_back({r * std::cos(angle), r * std::sin(angle), z});
  }
  return directions;
}

/// sum c_lm h_l(kr) Y_lm at offsets from the centre.
inline Complex evaluate(std::span<const Complex> coefficients, int order, double k, const Vec3& offset_m) {
  const double r = norm(offset_m);
  Complex sum{};
  for (int l = 0; l <= order; ++l) {
    Complex of_order{};
    for (int m = -l; m <= l; ++m) of_order += coefficients[l * l + l + m] * calc_harmonic(l, m, (1.0 / r) * offset_m);
    sum += calc_hankel(l, k * r) * of_order;
  }
  return sum;
}

inline double to_db(double ratio) { return 20.0 * std::log10(std::max(ratio, 1e-30)); }

/// (T, 3, n) from `find`(position, normal of the facet, number).
template <typename Find>
std::vector<float> sample_corners(const RadiatingSurface& surface, std::size_t count, const Find& find) {
  std::vector<float> velocity;
  for (const Facet& facet : surface.get_facets())
    for (const std::int32_t node : facet.corners)
      for (std::size_t m = 0; m < count; ++m) velocity.push_back(static_cast<float>(find(surface.get_nodes()[node], facet.normal, m)));
  return velocity;
}

/// Pressures (N, n) for n velocities at one wave number, their coefficients (n, (order + 1)^2), and the iteration counts.
struct Outcome {
  std::vector<std::complex<float>> pressure;
  std::vector<Complex> expansion;
  int order = 0;
  GmresResult gmres;

  std::span<const Complex> get_coefficients(std::size_t side) const {
    return std::span(expansion).subspan(side * count_harmonics(order), count_harmonics(order));
  }
};

/// For the velocities `sides`.
inline Outcome solve(const BoundaryEquations& equations, double k, const std::vector<std::int32_t>& sides) {
  const std::size_t unknowns = equations.get_surface().count_nodes(), count = sides.size();
  LinearSystem system;
  equations.assemble(k, sides, 0, unknowns, system);
  const BlockInverse inverse(system);
  Sides right(system.right, unknowns, count), pressure(unknowns, count);
  inverse.apply(right);
  const Multiply multiply = [&](const Sides& x, Sides& y) {
    system.multiply(x, y);
    inverse.apply(y);
  };
  Outcome outcome;
  outcome.gmres = solve_gmres(multiply, right, {}, pressure);
  outcome.pressure = pressure.list();
  outcome.order = find_order(k * equations.get_sphere().radius_m);
  outcome.expansion = calc_expansion(equations.get_surface(), equations.get_sphere(), k, outcome.order, outcome.pressure,
                                     equations.get_velocity(), equations.count_velocities(), sides);
  return outcome;
}

/// For all velocities.
inline Outcome solve(const BoundaryEquations& equations, double k) {
  std::vector<std::int32_t> sides(equations.count_velocities());
  std::iota(sides.begin(), sides.end(), 0);
  return solve(equations, k, sides);
}

}  // namespace carillon::air::testing
