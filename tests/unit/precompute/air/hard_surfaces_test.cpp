// Difficult surfaces and wave numbers for boundary elements.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <string>
#include <vector>

#include "precompute/air/equations.hpp"
#include "tests/unit/precompute/air/bodies.hpp"
#include "tests/unit/precompute/air/fields.hpp"

namespace carillon::air {
namespace {

using testing::calc_hankel;
using testing::calc_hankel_slope;
using testing::Complex;
using testing::make_ball;
using testing::Outcome;
using testing::Skin;
using testing::to_db;

/// z component of the unit normal of the ball that contains a point.
Outcome solve_rigid(const RadiatingSurface& surface, double k) {
  const BoundaryEquations equations(
      surface, find_enclosing_sphere(surface.get_nodes()),
      testing::sample_corners(surface, 1, [](const Vec3& place, const Vec3&, std::size_t) { return normalise(place)[2]; }), 1);
  return testing::solve(equations, k);
}

/// Far-field error of a ball of radius 1 that moves along z, in dB.
double find_error_db(const Outcome& outcome, double k) {
  const Complex wanted = std::sqrt(4.0 * std::numbers::pi / 3.0) / (k * calc_hankel_slope(1, k));
  double error = 0.0;
  for (std::size_t i = 0; i < outcome.expansion.size(); ++i) error += std::norm(outcome.expansion[i] - (i == 2 ? wanted : 0.0));
  return to_db(std::sqrt(error) / std::abs(wanted));
}

/// Inserts a node on the edge of corners 0 and 1 of the first triangle at the fraction `share`: two triangles become four.
Skin split_edge(Skin skin, double share) {
  const auto [a, b, c] = skin.triangles[0];
  const auto node = static_cast<std::int32_t>(skin.nodes_m.size());
  skin.nodes_m.push_back(skin.nodes_m[a] + share * (skin.nodes_m[b] - skin.nodes_m[a]));
  std::vector<Triangle> kept;
  for (const Triangle& t : skin.triangles) {
    bool is_split = false;
    for (std::size_t i = 0; i < 3 && !is_split; ++i) {
      const std::int32_t p = t[i], q = t[(i + 1) % 3], other = t[(i + 2) % 3];
      if ((p != a || q != b) && (p != b || q != a)) continue;
      kept.push_back({p, node, other});
      kept.push_back({node, q, other});
      is_split = true;
    }
    if (!is_split) kept.push_back(t);
  }
  skin.triangles = kept;
  return skin;
}

/// Inserts a node into the first triangle at `hat`: one triangle becomes three.
Skin split_triangle(Skin skin, const Vec3& hat) {
  const auto [a, b, c] = skin.triangles[0];
  const auto node = static_cast<std::int32_t>(skin.nodes_m.size());
  skin.nodes_m.push_back(hat[0] * skin.nodes_m[a] + hat[1] * skin.nodes_m[b] + hat[2] * skin.nodes_m[c]);
  skin.triangles[0] = {a, b, node};
  skin.triangles.push_back({b, c, node});
  skin.triangles.push_back({c, a, node});
  return skin;
}

TEST(hard_surfaces, needles_and_slivers_change_nothing) {
  const Skin ball = make_ball(7, 1.0);
  for (const double k : {0.1, 3.0}) {
    const double plain = find_error_db(solve_rigid(ball.make_surface(), k), k);
    for (const double thin : {1e-2, 1e-4, 1e-6}) {
      const std::vector<std::pair<std::string, Skin>> skins{{"two needles", split_edge(ball, thin)},
                                                            {"a sliver", split_triangle(ball, {0.5, 0.5 - thin, thin})}};
      for (const auto& [name, skin] : skins) {
        ASSERT_TRUE(testing::is_closed(skin));
        const RadiatingSurface surface = skin.make_surface();
        ASSERT_EQ(surface.count_facets(), ball.triangles.size() + 2);
        const Outcome outcome = solve_rigid(surface, k);
        const double error = find_error_db(outcome, k);
        EXPECT_TRUE(outcome.gmres.is_converged);
        EXPECT_LE(outcome.gmres.products, 30) << name;
        EXPECT_LE(error, plain + 1.0) << name << " " << thin << ", k " << k;
      }
    }
  }
}

TEST(hard_surfaces, two_balls_radiate_as_their_images_say) {
  // Two equal pulsating balls: at ka -> 0 the sum of both fluxes. Each field scatters at the other ball; the mid-plane is rigid, which
  // equals one ball near a rigid plane. The total power at low k is that of both fluxes at one point: four times that of one.
  const double gap = 0.5, k = 0.02;
  const Skin ball = make_ball(5, 1.0), both = testing::join(ball, ball, {2.0 + gap, 0.0, 0.0});
  ASSERT_TRUE(testing::is_closed(both));
  const RadiatingSurface surface = both.make_surface();
  EXPECT_NEAR(surface.calc_volume_m3(), 8.0 / 3.0 * std::numbers::pi, 1e-9);
  const BoundaryEquations equations(
      surface, find_enclosing_sphere(surface.get_nodes()),
      testing::sample_corners(surface, 2,
                              [&](const Vec3& place, const Vec3&, std::size_t m) { return m == 0 || place[0] < 1.0 + gap / 2.0; }),
      2);
  const Outcome outcome = testing::solve(equations, k);
  EXPECT_TRUE(outcome.gmres.is_converged);
  EXPECT_LE(outcome.gmres.products, 30);
  std::array<double, 2> power{};
  for (std::size_t side = 0; side < 2; ++side)
    for (const Complex& c : outcome.get_coefficients(side)) power[side] += std::norm(c);
  // sin(kd) / kd at the distance d and k^2 a^2 change that by less than 1e-3.
  EXPECT_NEAR(power[0] / power[1], 4.0, 0.01);
  // The flux itself: |c_00| = k Q / sqrt(4 pi).
  EXPECT_NEAR(std::abs(outcome.get_coefficients(0)[0]) * std::sqrt(4.0 * std::numbers::pi) / (k * surface.calc_area_m2()), 1.0, 0.01);
}

TEST(hard_surfaces, far_too_coarse_meshes_still_converge) {
  const RadiatingSurface surface = make_ball(8, 1.0).make_surface();
  for (const double k : {25.0, 40.0}) {
    const Outcome outcome = solve_rigid(surface, k);
    EXPECT_TRUE(outcome.gmres.is_converged) << k;
    EXPECT_LE(outcome.gmres.products, 60) << k;
    for (const Complex& c : outcome.expansion) ASSERT_TRUE(std::isfinite(std::norm(c)));
  }
}

TEST(hard_surfaces, very_low_wave_numbers_have_the_pressure_of_the_closed_form) {
  const RadiatingSurface surface = make_ball(8, 1.0).make_surface();
  for (const double k : {1e-4, 1e-6}) {
    const Outcome outcome = solve_rigid(surface, k);
    EXPECT_TRUE(outcome.gmres.is_converged);
    EXPECT_LE(outcome.gmres.products, 30);
    double error = 0.0, all = 0.0;
    for (std::size_t i = 0; i < surface.count_nodes(); ++i) {
      const Complex wanted = calc_hankel(1, k) / (k * calc_hankel_slope(1, k)) * normalise(surface.get_nodes()[i])[2];  // - z / 2
      error += std::norm(Complex(outcome.pressure[i]) - wanted);
      all += std::norm(wanted);
    }
    EXPECT_LT(std::sqrt(error / all), 0.015) << k;
  }
}

}  // namespace
}  // namespace carillon::air
