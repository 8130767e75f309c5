// Transfer of velocities to a coarser surface.
#include "precompute/air/transfer.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "tests/unit/precompute/air/bodies.hpp"
#include "tests/unit/precompute/air/fields.hpp"

namespace carillon::air {
namespace {

using testing::calc_harmonic;
using testing::make_ball;
using testing::make_box;
using testing::Skin;

template <typename Find>
Radiator make_radiator(const Skin& skin, std::size_t modes, const Find& find) {
  Radiator radiator{skin.nodes_m, skin.triangles, {}, std::vector<double>(modes, 1.0), find_enclosing_sphere(skin.nodes_m)};
  for (const Triangle& t : skin.triangles)
    for (const std::int32_t node : t)
      for (std::size_t m = 0; m < modes; ++m) radiator.velocity.push_back(static_cast<float>(find(skin.nodes_m[node], m)));
  return radiator;
}

double calc_area(const Radiator& radiator, std::size_t t) {
  const Triangle& c = radiator.triangles[t];
  return 0.5 * norm(cross(radiator.nodes_m[c[1]] - radiator.nodes_m[c[0]], radiator.nodes_m[c[2]] - radiator.nodes_m[c[0]]));
}

/// Volume velocity of a mode, and the integral of its absolute velocity.
double calc_flow(const Radiator& radiator, std::size_t mode, bool is_of_size = false) {
  double flow = 0.0;
  const std::size_t modes = radiator.count_modes();
  for (std::size_t t = 0; t < radiator.triangles.size(); ++t)
    for (std::size_t c = 0; c < 3; ++c) {
      const double v = radiator.velocity[(t * 3 + c) * modes + mode];
      flow += calc_area(radiator, t) / 3.0 * (is_of_size ? std::abs(v) : v);
    }
  return flow;
}

/// Largest difference at any corner from the expected value.
template <typename Find>
double find_worst(const Radiator& radiator, const Find& find) {
  double worst = 0.0;
  const std::size_t modes = radiator.count_modes();
  for (std::size_t t = 0; t < radiator.triangles.size(); ++t)
    for (std::size_t c = 0; c < 3; ++c)
      for (std::size_t m = 0; m < modes; ++m)
        worst = std::max(worst, std::abs(radiator.velocity[(t * 3 + c) * modes + m] - find(radiator.nodes_m[radiator.triangles[t][c]], m)));
  return worst;
}

TEST(transfer, keeps_the_flow_of_each_mode) {
  std::mt19937 random(3);
  std::normal_distribution<double> value;
  const Radiator fine = make_radiator(make_ball(16, 1.0), 6, [&](const Vec3& place, std::size_t m) {
    return m == 5 ? value(random) : calc_harmonic(static_cast<int>(m), 0, normalise(place)) + 0.2;
  });
  for (const int divisions : {4, 7, 11}) {
    const Skin coarse = make_ball(divisions, 1.0);
    const Radiator found = transfer(fine, coarse.nodes_m, coarse.triangles);
    ASSERT_EQ(found.velocity.size(), coarse.triangles.size() * 3 * 6);
    EXPECT_EQ(found.wave_number_1_m, fine.wave_number_1_m);
    for (std::size_t m = 0; m < 6; ++m)
      EXPECT_NEAR(calc_flow(found, m), calc_flow(fine, m), 1e-6 * calc_flow(fine, m, true)) << divisions << " " << m;
    for (const Vec3& node : found.nodes_m) EXPECT_LE(norm(node - found.sphere.centre_m), found.sphere.radius_m * (1.0 + 1e-12));
  }
}

TEST(transfer, keeps_constant_and_linear_velocities_on_flat_faces) {
  const auto find = [](const Vec3& place, std::size_t m) { return m == 0 ? 2.0 : 1.0 + 3.0 * place[0] - 5.0 * place[1] + 20.0 * place[2]; };
  const Radiator fine = make_radiator(make_box({0.3, 0.2, 0.02}, {60, 40, 4}), 2, find);
  const Skin coarse = make_box({0.3, 0.2, 0.02}, {15, 10, 1});  // four fine cells per coarse one
  EXPECT_LT(find_worst(transfer(fine, coarse.nodes_m, coarse.triangles), find), 2e-5);
  // Identity transfer.
  EXPECT_LT(find_worst(transfer(fine, fine.nodes_m, fine.triangles), find), 2e-5);
}

TEST(transfer, to_facets_of_any_size_radiates_as_the_field_itself) {
  // Fine facets across coarse edges go to one side, so corner values scatter; the total flux must not.
  const std::vector<int> orders{0, 1, 2, 3};
  const auto find = [&](const Vec3& place, std::size_t m) { return calc_harmonic(orders[m], 0, normalise(place)); };
  const Radiator fine = make_radiator(make_ball(17, 1.0), orders.size(), find);
  for (const int divisions : {9, 12}) {
    const Skin coarse = make_ball(divisions, 1.0);
    const Radiator found = transfer(fine, coarse.nodes_m, coarse.triangles), exact = make_radiator(coarse, orders.size(), find);
    const RadiatingSurface surface = coarse.make_surface();
    for (const double k : {0.3, 3.0}) {
      const auto radiate = [&](const Radiator& radiator) {
        std::vector<float> velocity;
        for (const std::int32_t source : surface.get_facet_sources())
          velocity.insert(velocity.end(), radiator.velocity.begin() + static_cast<std::ptrdiff_t>(source) * 3 * 4,
                          radiator.velocity.begin() + (static_cast<std::ptrdiff_t>(source) + 1) * 3 * 4);
        return testing::solve(BoundaryEquations(surface, exact.sphere, velocity, orders.size()), k);
      };
      const testing::Outcome of_found = radiate(found), of_exact = radiate(exact);
      for (std::size_t m = 0; m < orders.size(); ++m) {
        double error = 0.0, all = 0.0;
        for (std::size_t i = 0; i < of_exact.get_coefficients(m).size(); ++i) {
          const int l = static_cast<int>(std::sqrt(static_cast<double>(i)));
          const double there = std::norm(testing::calc_hankel(l, 2.0 * k));  // at two radii
          error += there * std::norm(of_found.get_coefficients(m)[i] - of_exact.get_coefficients(m)[i]);
          all += there * std::norm(of_exact.get_coefficients(m)[i]);
        }
        EXPECT_LE(10.0 * std::log10(error / all), -37.0) << divisions << " " << k << " " << m;
      }
    }
  }
}

TEST(transfer, of_a_smooth_field_is_near_the_field) {
  const auto find = [](const Vec3& place, std::size_t) { return calc_harmonic(2, 1, normalise(place)); };
  double last = 1.0;
  for (const int divisions : {4, 8, 12}) {
    const Radiator fine = make_radiator(make_ball(3 * divisions, 1.0), 1, find);
    const Skin coarse = make_ball(divisions, 1.0);
    const double worst = find_worst(transfer(fine, coarse.nodes_m, coarse.triangles), find);
    EXPECT_LT(worst, last);
    last = worst;
  }
  EXPECT_LT(last, 0.05);
}

TEST(transfer, leaves_facets_at_rest_that_nothing_is_near) {
  // A coarse body with a part that is missing in the fine one.
  const Radiator fine = make_radiator(make_ball(8, 1.0), 1, [](const Vec3&, std::size_t) { return 1.0; });
  const Skin ball = make_ball(4, 1.0), both = testing::join(ball, make_ball(2, 0.1), {5.0, 0.0, 0.0});
  const Radiator found = transfer(fine, both.nodes_m, both.triangles);
  for (std::size_t i = ball.triangles.size() * 3; i < found.velocity.size(); ++i) EXPECT_EQ(found.velocity[i], 0.0F);
  EXPECT_NEAR(calc_flow(found, 0), calc_flow(fine, 0), 1e-6 * calc_flow(fine, 0));
}

}  // namespace
}  // namespace carillon::air
