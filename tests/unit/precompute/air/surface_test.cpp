// Surfaces and their bounding spheres.
#include "precompute/air/surface.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <random>
#include <set>
#include <vector>

#include "runtime/base/error.hpp"
#include "tests/unit/precompute/air/bodies.hpp"

namespace carillon::air {
namespace {

using testing::make_ball;
using testing::make_box;
using testing::Skin;

TEST(surface, has_the_volume_and_the_area_of_a_ball_and_of_a_box) {
  const RadiatingSurface ball = make_ball(12, 0.3).make_surface();
  EXPECT_EQ(ball.count_nodes(), 1442U);
  EXPECT_EQ(ball.count_facets(), 2880U);
  EXPECT_EQ(ball.count_points(), 4320U);
  EXPECT_NEAR(ball.calc_volume_m3() / (4.0 / 3.0 * std::numbers::pi * 0.027), 1.0, 1e-9);
  EXPECT_NEAR(ball.calc_area_m2() / (4.0 * std::numbers::pi * 0.09), 1.0, 3e-3);
  const RadiatingSurface box = make_box({0.3, 0.2, 0.01}, {30, 20, 1}).make_surface();
  EXPECT_NEAR(box.calc_volume_m3(), 6e-4, 1e-15);
  EXPECT_NEAR(box.calc_area_m2(), 0.13, 1e-12);
}

TEST(surface, keeps_facets_and_says_where_they_were) {
  const Skin skin = make_ball(5, 1.0);
  const RadiatingSurface surface = skin.make_surface();
  std::set<std::int32_t> sources(surface.get_facet_sources().begin(), surface.get_facet_sources().end());
  EXPECT_EQ(sources.size(), skin.triangles.size());
  for (std::size_t t = 0; t < surface.count_facets(); ++t) {
    const Facet& facet = surface.get_facets()[t];
    const Triangle& given = skin.triangles[surface.get_facet_sources()[t]];
    Vec3 sum{};
    for (std::size_t c = 0; c < 3; ++c) {
      EXPECT_EQ(surface.get_nodes()[facet.corners[c]], skin.nodes_m[given[c]]);
      const EdgePoint& point = surface.get_points()[facet.points[c]];
      const Vec3 middle = 0.5 * (surface.get_nodes()[facet.corners[(c + 1) % 3]] + surface.get_nodes()[facet.corners[(c + 2) % 3]]);
      EXPECT_LT(norm(point.place_m - middle), 1e-15);
      EXPECT_LE(point.size_m, facet.size_m);
      sum = sum + facet.curl[c];
      EXPECT_NEAR(dot(facet.curl[c], facet.normal), 0.0, 1e-12);
    }
    EXPECT_LT(norm(sum), 1e-12);  // the hat functions sum to 1
    EXPECT_GT(dot(facet.normal, surface.get_nodes()[facet.corners[0]]), 0.9);
  }
}

TEST(surface, drops_facets_without_an_area) {
  Skin skin = make_ball(3, 1.0);
  const std::size_t triangles = skin.triangles.size(), nodes = skin.nodes_m.size();
  const Triangle first = skin.triangles[0];
  skin.nodes_m.push_back(0.5 * (skin.nodes_m[first[0]] + skin.nodes_m[first[1]]));
  skin.triangles.push_back({first[0], first[1], static_cast<std::int32_t>(nodes)});
  skin.triangles.push_back({first[0], first[0], first[1]});
  const RadiatingSurface surface = skin.make_surface();
  EXPECT_EQ(surface.count_facets(), triangles);
  EXPECT_EQ(surface.count_nodes(), nodes);
  for (const std::int32_t source : surface.get_facet_sources()) EXPECT_LT(source, static_cast<std::int32_t>(triangles));
}

TEST(surface, refuses_numbers_that_are_not_finite_and_surfaces_without_facets) {
  for (const double bad : {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    Skin skin = make_ball(2, 1.0);
    skin.nodes_m[7][1] = bad;
    EXPECT_THROW(skin.make_surface(), InputError);
  }
  EXPECT_THROW(RadiatingSurface({}, {}), InputError);
  EXPECT_THROW((Skin{{Vec3{0, 0, 0}, Vec3{1, 0, 0}, Vec3{2, 0, 0}}, {{0, 1, 2}}}.make_surface()), InputError);
}

TEST(enclosing_sphere, of_simple_points_is_known) {
  const Sphere point = find_enclosing_sphere(std::vector{Vec3{1, 2, 3}});
  EXPECT_EQ(point.centre_m, (Vec3{1, 2, 3}));
  EXPECT_EQ(point.radius_m, 0.0);
  const Sphere two = find_enclosing_sphere(std::vector{Vec3{1, 0, 0}, Vec3{3, 0, 0}, Vec3{1, 0, 0}});
  EXPECT_NEAR(two.radius_m, 1.0, 1e-12);
  EXPECT_LT(norm(two.centre_m - Vec3{2, 0, 0}), 1e-12);
  const Sphere four = find_enclosing_sphere(std::vector{Vec3{1, 1, 1}, Vec3{1, -1, -1}, Vec3{-1, 1, -1}, Vec3{-1, -1, 1}});
  EXPECT_NEAR(four.radius_m, std::numbers::sqrt3, 1e-12);
  EXPECT_LT(norm(four.centre_m), 1e-12);
  // A blunt triangle: its longest edge is the diameter. Coplanar points on a circle and on a grid.
  const Sphere blunt = find_enclosing_sphere(std::vector{Vec3{-1, 0, 5}, Vec3{1, 0, 5}, Vec3{0.1, 0.3, 5}});
  EXPECT_NEAR(blunt.radius_m, 1.0, 1e-12);
  std::vector<Vec3> circle, grid;
  for (int i = 0; i < 17; ++i) circle.push_back({2.0 + std::cos(0.37 * i), std::sin(0.37 * i), -1.0});
  for (int i = 0; i < 9; ++i)
    for (int j = 0; j < 5; ++j) grid.push_back({0.25 * i, 0.25 * j, 0.0});
  EXPECT_NEAR(find_enclosing_sphere(circle).radius_m, 1.0, 1e-4);
  const Sphere round = find_enclosing_sphere(grid);
  EXPECT_NEAR(round.radius_m, std::hypot(1.0, 0.5), 1e-9);
  EXPECT_LT(norm(round.centre_m - Vec3{1, 0.5, 0}), 1e-9);
}

/// Brute force: the smallest sphere through 2, 3 or 4 of the points that contains all.
double find_radius_by_trial(const std::vector<Vec3>& points) {
  double best = std::numeric_limits<double>::infinity();
  const auto offer = [&](const Vec3& centre, const Vec3& on) {
    const double radius = norm(on - centre);
    for (const Vec3& p : points)
      if (norm(p - centre) > radius * (1.0 + 1e-10)) return;
    best = std::min(best, radius);
  };
  const std::size_t n = points.size();
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < i; ++j) {
      offer(0.5 * (points[i] + points[j]), points[i]);
      for (std::size_t k = 0; k < j; ++k) {
        const Vec3 a = points[j] - points[i], b = points[k] - points[i], axis = cross(a, b);
        const double square = dot(axis, axis);
        offer(points[i] + (0.5 / square) * (dot(a, a) * cross(b, axis) + dot(b, b) * cross(axis, a)), points[i]);
        for (std::size_t l = 0; l < k; ++l) {
          const Vec3 c = points[l] - points[i];
          const double volume = dot(axis, c);
          offer(points[i] + (0.5 / volume) * (dot(a, a) * cross(b, c) + dot(b, b) * cross(c, a) + dot(c, c) * axis), points[i]);
        }
      }
    }
  return best;
}

TEST(enclosing_sphere, of_random_points_is_the_smallest_of_all_trials) {
  std::mt19937 random(11);
  std::normal_distribution<double> value;
  for (int trial = 0; trial < 60; ++trial) {
    std::vector<Vec3> points;
    const double flat = trial % 3 == 0 ? 1e-3 : 1.0;
    for (int i = 0; i < 4 + trial % 14; ++i) points.push_back({value(random), value(random), flat * value(random)});
    const Sphere sphere = find_enclosing_sphere(points);
    for (const Vec3& p : points) EXPECT_LE(norm(p - sphere.centre_m), sphere.radius_m * (1.0 + 1e-12));
    EXPECT_NEAR(sphere.radius_m / find_radius_by_trial(points), 1.0, 1e-9);
  }
}

TEST(enclosing_sphere, of_the_nodes_of_a_ball_is_the_ball) {
  const Skin skin = make_ball(12, 0.7);
  const Sphere sphere = find_enclosing_sphere(skin.nodes_m);
  EXPECT_NEAR(sphere.radius_m, norm(skin.nodes_m[0]), 1e-9);
  EXPECT_LT(norm(sphere.centre_m), 1e-8);
}

TEST(order_by_place, is_a_permutation_with_compact_runs) {
  std::mt19937 random(13);
  std::uniform_real_distribution<double> value;
  std::vector<Vec3> places;
  for (int i = 0; i < 1000; ++i) places.push_back({value(random), value(random), value(random)});
  const std::vector<std::int32_t> order = order_by_place(places, 16);
  EXPECT_EQ(std::set<std::int32_t>(order.begin(), order.end()).size(), places.size());
  // Sixteen of a thousand points in a unit cube fill a cube of side 0.25, whose diagonal is 0.43.
  double sum = 0.0;
  for (std::size_t first = 0; first < places.size(); first += 16) {
    double widest = 0.0;
    for (std::size_t i = first; i < std::min(first + 16, places.size()); ++i)
      for (std::size_t j = first; j < i; ++j) widest = std::max(widest, norm(places[order[i]] - places[order[j]]));
    sum += widest;
  }
  EXPECT_LT(sum / std::ceil(1000.0 / 16.0), 0.5);
}

}  // namespace
}  // namespace carillon::air
