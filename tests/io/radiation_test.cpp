// Radiation gains against closed forms of spheres and against brute-force integration.
#include "precompute/io/radiation.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <numbers>

namespace carillon::io {
namespace {

struct Shell {
  std::vector<Vec3> vertices_m;
  std::vector<Triangle> triangles;
};

/// An octahedron refined `times` times, on a sphere of the given radius; inward turns the triangles round.
Shell make_sphere(double radius, int times, Vec3 centre = {}, bool inward = false) {
  Shell shell{{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}},
              {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}}};
  for (int pass = 0; pass < times; ++pass) {
    std::map<std::pair<int, int>, int> middle;
    const auto between = [&](int a, int b) {
      const std::pair<int, int> key{std::min(a, b), std::max(a, b)};
      const auto [found, is_new] = middle.try_emplace(key, static_cast<int>(shell.vertices_m.size()));
      if (is_new) {
        Vec3 m;
        for (int k = 0; k < 3; ++k) m[k] = shell.vertices_m[a][k] + shell.vertices_m[b][k];
        const double length = std::hypot(m[0], m[1], m[2]);
        for (double& x : m) x /= length;
        shell.vertices_m.push_back(m);
      }
      return found->second;
    };
    std::vector<Triangle> finer;
    for (const auto& [a, b, c] : shell.triangles) {
      const int ab = between(a, b), bc = between(b, c), ca = between(c, a);
      finer.insert(finer.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
    }
    shell.triangles = std::move(finer);
  }
  for (Vec3& x : shell.vertices_m)
    for (int k = 0; k < 3; ++k) x[k] = x[k] * radius + centre[k];
  if (inward)
    for (Triangle& t : shell.triangles) std::swap(t[1], t[2]);
  return shell;
}

void append(Shell& shell, const Shell& other) {
  const auto shift = static_cast<std::int32_t>(shell.vertices_m.size());
  shell.vertices_m.insert(shell.vertices_m.end(), other.vertices_m.begin(), other.vertices_m.end());
  for (const auto& [a, b, c] : other.triangles) shell.triangles.push_back({a + shift, b + shift, c + shift});
}

/// One mode per field, (V, m, 3).
std::vector<double> sample(const Shell& shell, const std::vector<std::function<Vec3(const Vec3&)>>& fields) {
  std::vector<double> shapes;
  for (const Vec3& x : shell.vertices_m)
    for (const auto& field : fields) {
      const Vec3 u = field(x);
      shapes.insert(shapes.end(), u.begin(), u.end());
    }
  return shapes;
}

constexpr double kRhoC = 1.21 * 343;

TEST(RadiationGain, of_a_pulsating_sphere_is_the_pressure_of_the_closed_form) {
  // |p| / (rho0 c u) of a sphere of radius 0.1 m with uniform radial velocity u, at r = 2 m; at 1 m it is twice that.
  // Values: |h_0(kr) / h_0'(ka)| at 100, 500 and 1000 Hz, computed from spherical Hankel functions (Pierce 1981, section 4.1).
  const std::vector<std::pair<double, double>> expected{{100, 0.009009251798}, {500, 0.03377119291}, {1000, 0.04388653096}};
  const Shell shell = make_sphere(0.1, 5);
  const auto radial = [](const Vec3& x) { return Vec3{x[0] / 0.1, x[1] / 0.1, x[2] / 0.1}; };
  for (const auto& [freq_hz, at_two_metres] : expected) {
    const std::vector<double> omega{2 * std::numbers::pi * freq_hz};
    const auto gain = calc_radiation_gain(shell.vertices_m, shell.triangles, omega, sample(shell, {radial}));
    EXPECT_NEAR(gain[0] / (2 * at_two_metres * kRhoC), 1, 2e-3) << freq_hz;
  }
}

TEST(RadiationGain, of_a_trembling_sphere_is_half_that_of_a_pulsating_one_though_its_signed_sum_is_zero) {
  const Shell shell = make_sphere(0.1, 5);
  const auto radial = [](const Vec3& x) { return Vec3{x[0] / 0.1, x[1] / 0.1, x[2] / 0.1}; };
  const auto trembling = [](const Vec3&) { return Vec3{0, 0, 1}; };
  const auto quadrupole = [](const Vec3& x) {  // radial P_2(cos theta)
    const double c = x[2] / 0.1, p = (3 * c * c - 1) / 2;
    return Vec3{p * x[0] / 0.1, p * x[1] / 0.1, p * x[2] / 0.1};
  };
  const std::vector<double> omega(3, 1000.0);
  const auto gain = calc_radiation_gain(shell.vertices_m, shell.triangles, omega, sample(shell, {radial, trembling, quadrupole}));
  EXPECT_NEAR(gain[1] / gain[0], 0.5, 1e-3);     // mean of |cos theta|
  EXPECT_NEAR(gain[2] / gain[0], 0.3849, 1e-3);  // mean of |P_2| = 2 / (3 sqrt 3)
}

TEST(RadiationGain, of_a_motion_along_the_surface_is_zero) {
  const Shell shell = make_sphere(0.1, 4);
  const auto spin = [](const Vec3& x) { return Vec3{-x[1], x[0], 0}; };
  const auto gain = calc_radiation_gain(shell.vertices_m, shell.triangles, std::vector<double>{1000.0}, sample(shell, {spin}));
  const auto radial = [](const Vec3& x) { return x; };
  const auto loud = calc_radiation_gain(shell.vertices_m, shell.triangles, std::vector<double>{1000.0}, sample(shell, {radial}));
  EXPECT_LT(gain[0], 1e-2 * loud[0]);
}

TEST(RadiationGain, ignores_the_wall_of_a_closed_cavity) {
  const Shell outer = make_sphere(0.1, 3);
  Shell hollow = outer;
  append(hollow, make_sphere(0.08, 3, {}, true));
  const auto radial = [](const Vec3& x) { return x; };
  const std::vector<double> omega{1000.0};
  EXPECT_EQ(calc_radiation_gain(hollow.vertices_m, hollow.triangles, omega, sample(hollow, {radial})),
            calc_radiation_gain(outer.vertices_m, outer.triangles, omega, sample(outer, {radial})));
  EXPECT_EQ(find_outer_triangles(hollow.vertices_m, hollow.triangles), outer.triangles);
}

TEST(RadiationGain, counts_two_separate_bodies_wherever_they_are) {
  Shell two = make_sphere(0.1, 2, {5, 0, 0});
  append(two, make_sphere(0.1, 2, {-5, 3, 1}));
  EXPECT_EQ(find_outer_triangles(two.vertices_m, two.triangles).size(), two.triangles.size());
}

}  // namespace
}  // namespace carillon::io
