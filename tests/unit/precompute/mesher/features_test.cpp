// Sharp edges of bodies against noise, and meshing of scans.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "precompute/mesher/surface.hpp"
#include "precompute/mesher/tet_quality.hpp"
#include "precompute/mesher/triangle_surface.hpp"
#include "tests/unit/precompute/mesher/surfaces.hpp"

namespace carillon::mesher {
namespace {

using namespace testing;

constexpr double kSharpDeg = 40;

double calc_length(const std::vector<Polyline>& curves) {
  double length = 0;
  for (const Polyline& curve : curves)
    for (std::size_t i = 1; i < curve.size(); ++i) length += norm(curve[i] - curve[i - 1]);
  return length;
}

std::vector<Polyline> find_curves(const Polygons& body, double edge_m) {
  return find_sharp_curves(to_triangles(body), kSharpDeg, 3 * edge_m, 2 * edge_m);
}

/// A box of n x n squares a side, each of two triangles; edges of 1.
Polygons make_fine_box(int n) {
  std::map<std::array<double, 3>, int> number;
  Polygons s;
  const auto add = [&](std::array<double, 3> p) {
    const auto [found, fresh] = number.try_emplace(p, static_cast<int>(s.points.size()));
    if (fresh) s.points.push_back(p);
    return found->second;
  };
  for (int axis = 0; axis < 3; ++axis)
    for (const double side : {0.0, 1.0})
      for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
          const auto at = [&](int u, int v) {
            std::array<double, 3> p{};
            p[axis] = side, p[(axis + 1) % 3] = static_cast<double>(u) / n, p[(axis + 2) % 3] = static_cast<double>(v) / n;
            return add(p);
          };
          const int a = at(i, j), b = at(i + 1, j), c = at(i + 1, j + 1), d = at(i, j + 1);
          if (side > 0)
            s.faces.insert(s.faces.end(), {{a, b, c}, {a, c, d}});
          else
            s.faces.insert(s.faces.end(), {{a, c, b}, {a, d, c}});
        }
  return s;
}

TEST(features, sharp_edges) {
  // Lengths in closed form. The cylinder's two rims are polygons of 48 sides, the letter's outline has 10 corners on either side.
  const double rims = 2 * 48 * 2 * 0.02 * std::sin(std::numbers::pi / 48);
  double outline = 0.2;
  const auto n = make_letter_n();
  for (int i = 0; i < 10; ++i)
    outline += 2 * std::hypot(n.points[i][0] - n.points[(i + 1) % 10][0], n.points[i][1] - n.points[(i + 1) % 10][1]) / 10 * 10;
  outline += 9 * 0.2;
  for (const auto& [body, edge_m, length] : {std::tuple{make_box(1, 1, 1), 0.1, 12.0}, std::tuple{make_fine_box(12), 0.1, 12.0},
                                             std::tuple{make_box(0.3, 0.2, 0.002), 0.01, 4 * 0.502},
                                             std::tuple{make_cylinder(0.02, 0.1, 48), 0.005, rims}, std::tuple{n, 0.05, outline}}) {
    EXPECT_FALSE(is_scan(to_triangles(body), kSharpDeg));
    EXPECT_NEAR(calc_length(find_curves(body, edge_m)), length, 1e-9 * length) << body.points.size();
  }
}

TEST(features, noisy_scan) {
  for (const double roughness : {0.15, 0.2, 0.3, 0.45}) {
    const Polygons scan = roughen(make_sphere(0.05, 5), roughness);
    EXPECT_TRUE(is_scan(to_triangles(scan), kSharpDeg)) << roughness;
    // Where there is less noise, curve by curve: elements two triangles long.
    EXPECT_EQ(find_curves(roughen(make_sphere(0.05, 5), 0.08), 0.006).size(), 0u);
  }
  EXPECT_FALSE(is_scan(to_triangles(make_sphere(0.05, 5)), kSharpDeg));
}

TEST(features, edges_in_light_noise) {
  // Noise of 4 % of the squares: spurs grow on the edges, whose turn stays.
  const Polygons box = roughen(make_fine_box(16), 0.04);
  EXPECT_FALSE(is_scan(to_triangles(box), kSharpDeg));
  EXPECT_NEAR(calc_length(find_curves(box, 0.1)), 12, 0.6);
}

TEST(features, smoothing) {
  const double radius = 0.05;
  const Polygons ball = make_sphere(radius, 5);
  const auto calc_roughness = [&](const TriangleSurface& s) {  // root mean square of the distance from the ball
    double sum = 0;
    for (const Vec3& p : s.points) sum += std::pow(norm(p) - radius, 2);
    return std::sqrt(sum / static_cast<double>(s.points.size()));
  };
  TriangleSurface scan = to_triangles(roughen(ball, 0.2)), bound = scan;
  const double before = calc_roughness(scan);
  smooth_scan(scan, 1);
  EXPECT_LT(calc_roughness(scan), 0.5 * before);
  EXPECT_FALSE(is_scan(scan, kSharpDeg));
  const double exact = calc_volume(to_triangles(ball));
  EXPECT_NEAR(calc_volume(scan) / exact, 1, 0.003);
  const std::vector<Vec3> start = bound.points;
  const double farthest = smooth_scan(bound, 1e-4);
  EXPECT_NEAR(farthest, 1e-4, 1e-12);
  for (std::size_t v = 0; v < start.size(); ++v) EXPECT_LE(norm(bound.points[v] - start[v]), 1e-4 * (1 + 1e-9));
}

TEST(features, rough_scan_attempts) {
  const double radius = 0.05, exact = 4 * std::numbers::pi / 3 * std::pow(radius, 3);
  const auto path = write_text("scan.off", to_off(roughen(make_sphere(radius, 5), 0.2)));
  for (const bool is_hollow : {false, true}) {
    SurfaceReport report;
    const auto mesh = mesh_surface({.surface = path, .wall_m = is_hollow ? std::optional(0.008) : std::nullopt, .nodes = 4000}, report);
    EXPECT_NEAR(static_cast<double>(mesh.nodes_m.size()), 4000, 400);
    EXPECT_LE(report.attempts, 3);
    EXPECT_EQ(report.sharp_curves, 0);
    EXPECT_GT(report.smoothed_m, 0);
    EXPECT_LE(report.smoothed_m, 0.13 * report.edge_m);
    EXPECT_GT(report.min_dihedral_deg, 9);
    EXPECT_NEAR(report.volume_m3 / (is_hollow ? exact * (1 - std::pow(1 - 0.008 / radius, 3)) : exact), 1, 0.03);
  }
}

TEST(features, touching_boundaries) {
  const Polygons box = make_box(1, 1, 1);
  std::vector<Triangle> faces = to_triangles(box).triangles;
  EXPECT_EQ(count_pinches(faces), 0);
  const auto add = [&](const std::vector<std::int32_t>& number) {  // another box whose corners have these numbers
    for (const Triangle& t : to_triangles(box).triangles) faces.push_back({number[t[0]], number[t[1]], number[t[2]]});
  };
  add({8, 9, 10, 11, 12, 13, 14, 15});
  EXPECT_EQ(count_pinches(faces), 0);
  add({15, 16, 17, 18, 19, 20, 21, 22});  // shares a corner with the second
  EXPECT_EQ(count_pinches(faces), 1);
  faces.resize(12);
  add({0, 1, 8, 9, 10, 11, 12, 13});  // an edge with the first
  EXPECT_EQ(count_pinches(faces), 1);
  faces.pop_back();  // and a hole of three edges
  EXPECT_GE(count_pinches(faces), 4);
}

/// Height deficit of the solid bunny's mesh at the ears.
TEST(features, bunny_ears) {
  const std::filesystem::path bunny = "/usr/share/glmark2/models/bunny.obj";
  if (!std::filesystem::exists(bunny)) GTEST_SKIP() << "glmark2-data is not installed";
  const auto is_warned = [](const SurfaceReport& r) {
    return std::any_of(r.notes.begin(), r.notes.end(),
                       [](const std::string& note) { return note.find("three cells") != std::string::npos; });
  };
  SurfaceReport kept, cut, ball;
  mesh_surface({.surface = bunny, .height_m = 0.13, .nodes = 8000}, kept);
  EXPECT_EQ(kept.method, Method::kDelaunay);
  EXPECT_NEAR(kept.mesh_extent_m[1], 0.13, 0.0015);
  EXPECT_FALSE(is_warned(kept));
  mesh_surface({.surface = bunny, .height_m = 0.13, .nodes = 8000, .method = Method::kStuffing}, cut);
  EXPECT_LT(cut.mesh_extent_m[1], kept.mesh_extent_m[1]);
  EXPECT_TRUE(is_warned(cut));
  mesh_surface({.surface = write_text("fit.off", to_off(make_sphere(0.05, 5))), .nodes = 8000, .method = Method::kStuffing}, ball);
  EXPECT_FALSE(is_warned(ball));
}

TEST(features, narrow_rims) {
  // Steps of 1 to 2 mm on a body of 100 mm: their edges add most of the nodes, not covered by the count model.
  std::vector<std::array<double, 2>> profile{{0.04, 0},    {0.04, 0.0015}, {0.042, 0.0015}, {0.042, 0.003},  {0.05, 0.003},
                                             {0.05, 0.06}, {0.048, 0.06},  {0.048, 0.0615}, {0.045, 0.0615}, {0.045, 0.063}};
  const auto path = write_text("rims.off", to_off(make_lathe(profile, 48, Cut::kDiagonal)));
  SurfaceReport report;
  const auto mesh = mesh_surface({.surface = path, .nodes = 12000}, report);
  EXPECT_NEAR(static_cast<double>(mesh.nodes_m.size()), 12000, 1200);
  EXPECT_LE(report.attempts, 4);
  EXPECT_GE(report.sharp_curves, 10);
}

}  // namespace
}  // namespace carillon::mesher
