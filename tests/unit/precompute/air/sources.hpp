// Sources inside a body: its surface moves with their field, so the exterior solution must equal that field. Valid for every closed surface
// and wave number.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <numbers>
#include <span>
#include <vector>

#include "precompute/air/equations.hpp"
#include "tests/unit/precompute/air/bodies.hpp"
#include "tests/unit/precompute/air/fields.hpp"

namespace carillon::air::testing {

/// A monopole and a dipole at one point.
struct Source {
  Vec3 place_m{};
  double monopole = 0.0;
  Vec3 dipole{};
};

using Sources = std::vector<Source>;

/// G = e^{ikr} / 4 pi r, and its derivatives by r.
struct Pulse {
  Complex value, slope, bend;
};
inline Pulse calc_pulse(double k, double r) {
  const Complex value = std::polar(1.0 / (4.0 * std::numbers::pi * r), k * r), rate(-1.0 / r, k);
  return {value, rate * value, (rate * rate + 1.0 / (r * r)) * value};
}

inline Complex calc_pressure(const Sources& sources, double k, const Vec3& x) {
  Complex sum{};
  for (const Source& source : sources) {
    const Vec3 away = x - source.place_m;
    const double r = norm(away);
    const Pulse g = calc_pulse(k, r);
    sum += source.monopole * g.value + (dot(source.dipole, away) / r) * g.slope;
  }
  return sum;
}

inline Complex calc_slope(const Sources& sources, double k, const Vec3& x, const Vec3& normal) {
  Complex sum{};
  for (const Source& source : sources) {
    const Vec3 away = x - source.place_m;
    const double r = norm(away);
    const Vec3 e = (1.0 / r) * away;
    const Pulse g = calc_pulse(k, r);
    const double along = dot(e, normal), by_dipole = dot(e, source.dipole), across = dot(source.dipole, normal) - along * by_dipole;
    sum += source.monopole * along * g.slope + by_dipole * along * g.bend + (across / r) * g.slope;
  }
  return sum;
}

/// (T, 3, 2 n), real and imaginary parts of n slopes dp/dn, which `find` returns for (position, normal, number): least-squares linear
/// function on each facet, by seven points.
template <typename Find>
std::vector<float> project(const RadiatingSurface& surface, std::size_t count, const Find& find) {
  const double root = std::sqrt(15.0);
  struct Point {
    Vec3 hat{};
    double weight = 0.0;
  };
  std::vector<Point> points{{{1.0 / 3, 1.0 / 3, 1.0 / 3}, 9.0 / 40.0}};
  for (const double sign : {-1.0, 1.0}) {
    const double a = (6.0 + sign * root) / 21.0, weight = (155.0 + sign * root) / 1200.0;
    for (std::size_t c = 0; c < 3; ++c) {
      Vec3 hat{a, a, a};
      hat[c] = 1.0 - 2.0 * a;
      points.push_back({hat, weight});
    }
  }
  std::vector<float> velocity;
  std::vector<std::array<Complex, 3>> moments(count);  // over the area
  for (const Facet& facet : surface.get_facets()) {
    std::fill(moments.begin(), moments.end(), std::array<Complex, 3>{});
    for (const Point& point : points) {
      Vec3 place{};
      for (std::size_t c = 0; c < 3; ++c) place = place + point.hat[c] * surface.get_nodes()[facet.corners[c]];
      for (std::size_t i = 0; i < count; ++i) {
        const Complex slope = point.weight * find(place, facet.normal, i);
        for (std::size_t c = 0; c < 3; ++c) moments[i][c] += point.hat[c] * slope;
      }
    }
    // The inverse of (1 + 11^T) / 12 is 12 - 3 11^T.
    for (std::size_t c = 0; c < 3; ++c)
      for (const auto& moment : moments) {
        const Complex corner = 12.0 * moment[c] - 3.0 * (moment[0] + moment[1] + moment[2]);
        velocity.push_back(static_cast<float>(corner.real()));
        velocity.push_back(static_cast<float>(corner.imag()));
      }
  }
  return velocity;
}

/// Errors of the exterior solution at one wave number.
struct SourceErrors {
  double k = 0.0;
  double near_db = 0.0, far_db = 0.0;  // rms over directions at two radii and at a hundred
  int products = 0;
  bool is_converged = false;
  double nodes_per_wave = 0.0;
};

/// For the field of `sources` outside the surface, at several wave numbers; integrals independent of the wave number are done once.
inline std::vector<SourceErrors> find_source_errors(const RadiatingSurface& surface, const Sources& sources,
                                                    const std::vector<double>& wave_numbers) {
  std::vector<float> velocity = project(surface, wave_numbers.size(), [&](const Vec3& place, const Vec3& normal, std::size_t i) {
    return calc_slope(sources, wave_numbers[i], place, normal);
  });
  const BoundaryEquations equations(surface, find_enclosing_sphere(surface.get_nodes()), std::move(velocity), 2 * wave_numbers.size());
  const Sphere& sphere = equations.get_sphere();
  // Even triangles of side h around N nodes have the area N sqrt(3) / 2 h^2.
  const double spacing = std::sqrt(surface.calc_area_m2() / (static_cast<double>(surface.count_nodes()) * std::sqrt(3.0) / 2.0));
  std::vector<SourceErrors> found;
  for (std::size_t i = 0; i < wave_numbers.size(); ++i) {
    const double k = wave_numbers[i];
    const Outcome outcome = solve(equations, k, {static_cast<std::int32_t>(2 * i), static_cast<std::int32_t>(2 * i + 1)});
    std::vector<Complex> coefficients;
    for (std::size_t n = 0; n < outcome.get_coefficients(0).size(); ++n)
      coefficients.push_back(outcome.get_coefficients(0)[n] + Complex(0, 1) * outcome.get_coefficients(1)[n]);
    const auto compare = [&](double r) {
      double error = 0.0, all = 0.0;
      for (const Vec3& to : spread_directions(40)) {
        const Complex wanted = calc_pressure(sources, k, sphere.centre_m + r * to);
        error += std::norm(evaluate(coefficients, outcome.order, k, r * to) - wanted);
        all += std::norm(wanted);
      }
      return to_db(std::sqrt(error / all));
    };
    found.push_back({k, compare(2.0 * sphere.radius_m), compare(100.0 * sphere.radius_m), outcome.gmres.products,
                     outcome.gmres.is_converged, 2.0 * std::numbers::pi / (k * spacing)});
  }
  return found;
}

/// `count` wave numbers in geometric progression.
inline std::vector<double> spread_wave_numbers(double low, double high, std::size_t count) {
  std::vector<double> wave_numbers;
  for (std::size_t i = 0; i < count; ++i)
    wave_numbers.push_back(low * std::pow(high / low, static_cast<double>(i) / static_cast<double>(count - 1)));
  return wave_numbers;
}

/// On the mid-plane of a plate, closer to each other than to its faces, tapered towards the rim of a patch: transverse dipoles as in
/// bending, and monopoles of the strength `monopole`.
inline Sources fill_plate(double spacing_m, const std::array<int, 2>& count, double monopole) {
  Sources sources;
  const auto [nx, ny] = count;
  for (int i = 0; i < nx; ++i)
    for (int j = 0; j < ny; ++j) {
      const double x = (i + 0.5) / nx, y = (j + 0.5) / ny;
      const double fade = std::pow(std::sin(std::numbers::pi * x) * std::sin(std::numbers::pi * y), 2);
      sources.push_back(
          {{spacing_m * nx * (x - 0.5) + 0.03, spacing_m * ny * (y - 0.5) - 0.02, 0.0}, monopole * fade, {0.0, 0.0, 0.05 * fade}});
    }
  return sources;
}

/// Sources on the meridian of a wall, tapered towards its ends.
inline Sources fill_wall(const std::vector<Place>& middle, double spacing_m) {
  Sources sources;
  for (std::size_t i = 0; i < middle.size(); ++i) {
    const double along = static_cast<double>(i) / static_cast<double>(middle.size() - 1), fade = 1.0 - std::pow(along, 4);
    const auto [r, z] = middle[i];
    const int count = std::max(1, static_cast<int>(std::lround(2.0 * std::numbers::pi * r / spacing_m)));
    const double share = 1.0 / static_cast<double>(middle.size());
    for (int k = 0; k < count; ++k) {
      const double angle = 2.0 * std::numbers::pi * k / count;
      const Vec3 around{std::cos(angle), std::sin(angle), 0.0};
      const double weight = share * fade * std::max(r, spacing_m / (2.0 * std::numbers::pi)) / count;
      sources.push_back(
          {{r * around[0], r * around[1], z}, weight * (1.0 + 0.5 * around[0]), (0.2 * weight * std::cos(2.0 * angle)) * around});
    }
  }
  return sources;
}

/// For make_bowl(): from the lowest point to near the rim.
inline Sources fill_bowl(double wall_m, double spacing_m) {
  std::vector<Place> middle;
  const int parts = static_cast<int>(std::lround(1.36 / spacing_m));
  for (int i = 0; i < parts; ++i) {
    const double angle = 0.5 * std::numbers::pi * 0.93 * i / (parts - 1.0);
    middle.push_back({(1.0 - wall_m / 2.0) * std::sin(angle), -(1.0 - wall_m / 2.0) * std::cos(angle)});
  }
  return fill_wall(middle, spacing_m);
}

/// For make_bell(): half way between outside and inside.
inline Sources fill_bell(double spacing_m) {
  std::vector<Place> middle;
  const auto outside = get_bell_outside();
  auto inside = get_bell_inside();
  std::reverse(inside.begin(), inside.end());
  for (std::size_t i = 0; i < outside.size(); ++i)
    middle.push_back({0.5 * (outside[i][0] + inside[i][0]), 0.5 * (outside[i][1] + inside[i][1])});
  middle.back()[1] += 0.03;
  return fill_wall(divide(middle, spacing_m), spacing_m);
}

}  // namespace carillon::air::testing
