// Sources inside a body: its surface moves as their field does, and the air outside must have that field. Holds for every closed surface,
// at every wave number.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "precompute/bem/equations.hpp"
#include "tests/unit/precompute/bem/bodies.hpp"
#include "tests/unit/precompute/bem/fields.hpp"

namespace carillon::bem {
namespace {

using testing::Complex;
using testing::make_ball;
using testing::make_bell;
using testing::make_bowl;
using testing::make_box;
using testing::Outcome;
using testing::Skin;
using testing::to_db;

/// A monopole and a dipole at one place.
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
Pulse calc_pulse(double k, double r) {
  const Complex value = std::polar(1.0 / (4.0 * std::numbers::pi * r), k * r), rate(-1.0 / r, k);
  return {value, rate * value, (rate * rate + 1.0 / (r * r)) * value};
}

Complex calc_pressure(const Sources& sources, double k, const Vec3& x) {
  Complex sum{};
  for (const Source& source : sources) {
    const Vec3 away = x - source.place_m;
    const double r = norm(away);
    const Pulse g = calc_pulse(k, r);
    sum += source.monopole * g.value + (dot(source.dipole, away) / r) * g.slope;
  }
  return sum;
}

Complex calc_slope(const Sources& sources, double k, const Vec3& x, const Vec3& normal) {
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

/// (T, 3, 2): on each facet the linear function nearest to dp/dn in the mean square, by seven points; real and imaginary part.
std::vector<float> project(const RadiatingSurface& surface, const Sources& sources, double k) {
  const double root = std::sqrt(15.0);
  std::vector<float> velocity;
  for (const Facet& facet : surface.get_facets()) {
    std::array<Complex, 3> moments{};  // over the area
    const auto add = [&](const Vec3& hat, double weight) {
      Vec3 place{};
      for (std::size_t c = 0; c < 3; ++c) place = place + hat[c] * surface.get_nodes()[facet.corners[c]];
      const Complex slope = weight * calc_slope(sources, k, place, facet.normal);
      for (std::size_t c = 0; c < 3; ++c) moments[c] += hat[c] * slope;
    };
    add({1.0 / 3, 1.0 / 3, 1.0 / 3}, 9.0 / 40.0);
    for (const double sign : {-1.0, 1.0}) {
      const double a = (6.0 + sign * root) / 21.0, weight = (155.0 + sign * root) / 1200.0;
      for (std::size_t c = 0; c < 3; ++c) {
        Vec3 hat{a, a, a};
        hat[c] = 1.0 - 2.0 * a;
        add(hat, weight);
      }
    }
    // The inverse of (1 + 11^T) / 12 is 12 - 3 11^T.
    const Complex sum = moments[0] + moments[1] + moments[2];
    for (std::size_t c = 0; c < 3; ++c) {
      const Complex corner = 12.0 * moments[c] - 3.0 * sum;
      velocity.push_back(static_cast<float>(corner.real()));
      velocity.push_back(static_cast<float>(corner.imag()));
    }
  }
  return velocity;
}

struct Errors {
  double near_db = 0.0, far_db = 0.0;  // rms over directions at two radii and at a hundred
  int products = 0;
  double nodes_per_wave = 0.0;
};

Errors find_errors(const Skin& skin, const Sources& sources, double k) {
  const RadiatingSurface surface = skin.make_surface();
  const BoundaryEquations equations(surface, find_enclosing_sphere(surface.get_nodes()), project(surface, sources, k), 2);
  const Outcome outcome = testing::solve(equations, k);
  EXPECT_TRUE(outcome.gmres.is_converged);
  const Sphere& sphere = equations.get_sphere();
  std::vector<Complex> coefficients;
  for (std::size_t i = 0; i < outcome.get_coefficients(0).size(); ++i)
    coefficients.push_back(outcome.get_coefficients(0)[i] + Complex(0, 1) * outcome.get_coefficients(1)[i]);
  const auto compare = [&](double r) {
    double error = 0.0, all = 0.0;
    for (const Vec3& to : testing::spread_directions(40)) {
      const Complex wanted = calc_pressure(sources, k, sphere.centre_m + r * to);
      error += std::norm(testing::evaluate(coefficients, outcome.order, k, r * to) - wanted);
      all += std::norm(wanted);
    }
    return to_db(std::sqrt(error / all));
  };
  // Even triangles of side h around N nodes have the area N sqrt(3) / 2 h^2.
  const double spacing = std::sqrt(surface.calc_area_m2() / (static_cast<double>(surface.count_nodes()) * std::sqrt(3.0) / 2.0));
  return {compare(2.0 * sphere.radius_m), compare(100.0 * sphere.radius_m), outcome.gmres.products, 2.0 * std::numbers::pi / (k * spacing)};
}

void expect_exact(const char* name, const Skin& skin, const Sources& sources, const std::vector<double>& wave_numbers, int most_products) {
  ASSERT_TRUE(testing::is_closed(skin));
  ASSERT_GT(testing::calc_volume(skin), 0.0);
  for (const double k : wave_numbers) {
    const Errors found = find_errors(skin, sources, k);
    ASSERT_GE(found.nodes_per_wave, 6.0) << "the test asks for more than the mesh has";
    EXPECT_LE(found.near_db, -40.0) << name << ", k " << k;
    EXPECT_LE(found.far_db, -40.0) << name << ", k " << k;
    EXPECT_LE(found.products, most_products) << name << ", k " << k;
  }
}

TEST(inside_source, of_a_ball_is_heard_outside) {
  const Sources sources{{{0.2, -0.1, 0.15}, 1.0, {0.2, 0.3, -0.25}}};
  expect_exact("ball", make_ball(9, 1.0), sources, {0.01, 0.5, 2.0, std::numbers::pi, 7.0}, 30);
}

TEST(inside_source, of_a_thin_plate_is_heard_outside) {
  // Sources on the middle plane, closer to each other than to the faces, that fade towards the rim of a patch: dipoles across it, as a
  // plate that bends, and monopoles.
  Sources sources;
  const int nx = 34, ny = 22;
  const double spacing = 0.004;
  for (int i = 0; i < nx; ++i)
    for (int j = 0; j < ny; ++j) {
      const double x = (i + 0.5) / nx, y = (j + 0.5) / ny;
      const double fade = std::pow(std::sin(std::numbers::pi * x) * std::sin(std::numbers::pi * y), 2);
      sources.push_back({{spacing * nx * (x - 0.5) + 0.03, spacing * ny * (y - 0.5) - 0.02, 0.0}, fade, {0.0, 0.0, 0.05 * fade}});
    }
  const Skin plate = make_box({0.3, 0.2, 0.01}, {30, 20, 1});
  expect_exact("plate", plate, sources, {1.0, 80.0}, 60);
  for (Source& source : sources) source.monopole = 0.0;
  expect_exact("plate that bends", plate, sources, {1.0, 10.0, 80.0}, 60);
}

/// Sources on the meridian of a wall, which fade towards its ends.
Sources fill_wall(const std::vector<testing::Place>& middle, double spacing_m) {
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

TEST(inside_source, of_the_wall_of_a_bowl_is_heard_outside_and_inside_the_bowl) {
  const double wall = 0.15, spacing = 0.075;
  std::vector<testing::Place> middle;
  for (int i = 0; i < 18; ++i) {
    const double angle = 0.5 * std::numbers::pi * 0.93 * i / 17.0;
    middle.push_back({(1.0 - wall / 2.0) * std::sin(angle), -(1.0 - wall / 2.0) * std::cos(angle)});
  }
  expect_exact("bowl", make_bowl(wall, 0.105), fill_wall(middle, spacing), {0.1, 1.5, 4.0, 8.0}, 60);
}

TEST(inside_source, of_the_wall_of_a_bell_is_heard_outside) {
  // Half way between outside and inside.
  std::vector<testing::Place> middle;
  const auto outside = testing::get_bell_outside();
  auto inside = testing::get_bell_inside();
  std::reverse(inside.begin(), inside.end());
  for (std::size_t i = 0; i < outside.size(); ++i)
    middle.push_back({0.5 * (outside[i][0] + inside[i][0]), 0.5 * (outside[i][1] + inside[i][1])});
  middle.back()[1] += 0.03;
  expect_exact("bell", make_bell(0.06), fill_wall(testing::divide(middle, 0.04), 0.04), {0.3, 3.0, 8.0, 14.0}, 60);
}

}  // namespace
}  // namespace carillon::bem
