// Mid-side nodes on true surfaces: spheres, tori, cylinders and flats known in closed form.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>

#include "precompute/mesh/check.hpp"
#include "precompute/mesher/surface.hpp"
#include "tests/unit/precompute/mesher/surfaces.hpp"

namespace carillon::mesher {
namespace {

using namespace testing;
using Point = std::array<double, 3>;

/// The mid nodes of a second-order mesh that lie on its boundary, each with the ends of its edge.
struct MidNode {
  Point at, a, b;
};

std::vector<MidNode> list_boundary_mid_nodes(const mesh::TetMesh& m) {
  constexpr int kSides[4][3] = {{5, 9, 8}, {6, 9, 7}, {4, 8, 7}, {4, 5, 6}};  // mid nodes of the face opposite each corner
  constexpr int kEnds[6][2] = {{0, 1}, {1, 2}, {0, 2}, {0, 3}, {1, 3}, {2, 3}};
  std::map<std::int32_t, MidNode> found;
  for (const auto& [face, owners] : find_face_owners(m)) {
    if (owners.size() != 1) continue;
    const auto tet = m.tet(owners[0].first);
    for (const int side : kSides[owners[0].second])
      found[tet[side]] = {m.nodes_m[tet[side]], m.nodes_m[tet[kEnds[side - 4][0]]], m.nodes_m[tet[kEnds[side - 4][1]]]};
  }
  std::vector<MidNode> out;
  for (const auto& [node, mid] : found) out.push_back(mid);
  return out;
}

double calc_radius(const Point& p) { return std::hypot(p[0], p[1], p[2]); }

mesh::TetMesh make(const std::string& name, const Polygons& surface, SurfaceOptions options, SurfaceReport& report) {
  options.surface = write_text(name, to_off(surface));
  options.order = 2;
  mesh::TetMesh m = mesh_surface(options, report);
  mesh::TetMesh copy = m;
  const auto check = mesh::check_mesh(copy, name);  // nothing is left to repair for those who read it
  EXPECT_EQ(check.straightened + check.reoriented + check.unreferenced + check.welded + check.pinched_nodes, 0);
  return m;
}

double calc_volume(const mesh::TetMesh& m) {
  mesh::TetMesh copy = m;
  return mesh::check_mesh(copy).volume_m3;
}

TEST(curved, faceted_ball) {
  const double radius = 0.05;
  const auto calc_worst = [&](bool facets, bool straight) {
    SurfaceReport report;
    double worst = 0;
    const auto m = make("ball.off", make_sphere(radius, 3), {.nodes = 4000, .facets = facets, .straight = straight}, report);
    for (const MidNode& mid : list_boundary_mid_nodes(m)) worst = std::max(worst, std::abs(calc_radius(mid.at) / radius - 1));
    return worst;
  };
  EXPECT_LT(calc_worst(false, false), 1e-3);
  EXPECT_GT(calc_worst(true, false), 5e-3);   // the 512 facets themselves lie up to 0.6 % under the sphere
  EXPECT_GT(calc_worst(false, true), 0.015);  // the chords of the mesh
}

TEST(curved, curved_ball_volume) {
  const double exact = 4 * std::numbers::pi / 3;
  for (const std::int64_t nodes : {2000, 9000}) {
    const auto calc_error = [&](bool straight) {
      SurfaceReport report;
      const auto m = make("ball4.off", make_sphere(1, 4), {.nodes = nodes, .straight = straight}, report);
      EXPECT_NEAR(report.volume_m3, calc_volume(m), 1e-9);
      return std::abs(calc_volume(m) / exact - 1);
    };
    const double straight = calc_error(true), curved = calc_error(false);
    EXPECT_GT(straight, 0.01);
    EXPECT_LT(curved, straight / 15) << nodes;
    EXPECT_LT(curved, 2e-3) << nodes;
  }
}

TEST(curved, hollow_ball_skins) {
  const double radius = 0.05, wall = 0.006;
  SurfaceReport report;
  const auto m = make("shell.off", make_sphere(radius, 4), {.wall_m = wall, .nodes = 9000}, report);
  int outer = 0, inner = 0;
  double worst = 0;
  for (const MidNode& mid : list_boundary_mid_nodes(m)) {
    const double r = calc_radius(mid.at), skin = r > radius - wall / 2 ? radius : radius - wall;
    ++(skin == radius ? outer : inner);
    worst = std::max(worst, std::abs(r - skin));
  }
  EXPECT_GT(outer, 500);
  EXPECT_GT(inner, 500);
  EXPECT_LT(worst, 0.01 * wall);
  const double exact = 4 * std::numbers::pi / 3 * (std::pow(radius, 3) - std::pow(radius - wall, 3));
  EXPECT_NEAR(calc_volume(m) / exact, 1, 2e-3);
}

TEST(curved, faceted_torus) {
  const double large = 0.05, small = 0.015;
  SurfaceReport report;
  const auto m = make("torus.off", make_torus(large, small, 48, 24), {.nodes = 6000}, report);
  std::vector<double> off;
  for (const MidNode& mid : list_boundary_mid_nodes(m))
    off.push_back(std::abs(std::hypot(std::hypot(mid.at[0], mid.at[1]) - large, mid.at[2]) - small));
  std::sort(off.begin(), off.end());
  EXPECT_LT(off[off.size() * 97 / 100], 0.005 * small);  // the rest belongs to elements that would have folded
  EXPECT_LE(off.end() - std::upper_bound(off.begin(), off.end(), 0.005 * small), 6 * report.straightened_tets);
  EXPECT_NEAR(calc_volume(m) / (2 * std::numbers::pi * std::numbers::pi * large * small * small), 1, 4e-3);
}

TEST(curved, cylinder_rims_and_ends) {
  const double radius = 0.01, length = 0.05;
  SurfaceReport report;
  const auto m = make("cylinder.off", make_cylinder(radius, length, 24), {.nodes = 5000}, report);
  int on_rim = 0, on_ends = 0;
  for (const MidNode& mid : list_boundary_mid_nodes(m)) {
    const auto is_on_rim = [&](const Point& p) {
      return std::abs(std::abs(p[2]) - length / 2) < 1e-12 && std::abs(std::hypot(p[0], p[1]) - radius) < 1e-3 * radius;
    };
    const double r = std::hypot(mid.at[0], mid.at[1]);
    if (std::abs(mid.a[2] - mid.b[2]) < 1e-12 && std::abs(std::abs(mid.a[2]) - length / 2) < 1e-12) {
      ++on_ends;
      EXPECT_NEAR(mid.at[2], mid.a[2], 1e-12);
    }
    if (is_on_rim(mid.a) && is_on_rim(mid.b) && mid.a[2] * mid.b[2] > 0 && std::hypot(mid.a[0] - mid.b[0], mid.a[1] - mid.b[1]) < radius) {
      ++on_rim;
      EXPECT_NEAR(r, radius, 2e-3 * radius);
    }
  }
  EXPECT_GT(on_rim, 20);
  EXPECT_GT(on_ends, 100);
  EXPECT_EQ(report.sharp_curves, 2);
  EXPECT_NEAR(calc_volume(m) / (std::numbers::pi * radius * radius * length), 1, 5e-3);
}

TEST(curved, straight_box) {
  SurfaceReport report;
  const auto m = make("box.off", make_box(3, 2, 1), {.nodes = 4000}, report);
  EXPECT_EQ(report.curved_edges, 0);
  EXPECT_EQ(report.facet_pieces, 1);
  EXPECT_NEAR(calc_volume(m), 6, 1e-9);
}

TEST(curved, fillets) {
  const double a = 0.03, b = 0.02, fillet = 0.006, length = 0.05;
  SurfaceReport report;
  const auto m = make("fillet.off", make_filleted_bar(a, b, fillet, length, 4), {.nodes = 12000}, report);
  for (const auto& p : m.nodes_m) {
    ASSERT_LT(std::abs(p[0]), a + 1e-9);  // nothing bulges out of the planes
    ASSERT_LT(std::abs(p[1]), b + 1e-9);
    ASSERT_LT(std::abs(p[2]), length / 2 + 1e-9);
  }
  const double exact = (4 * a * b - (4 - std::numbers::pi) * fillet * fillet) * length;
  EXPECT_NEAR(calc_volume(m) / exact, 1, 1e-3);
}

TEST(curved, facets_option) {
  const double radius = 0.01, length = 0.05, exact = 6 * std::sin(std::numbers::pi / 6) * radius * radius * length;  // twelve sides
  SurfaceReport report;
  const auto m = make("prism.off", make_cylinder(radius, length, 12), {.nodes = 3000, .facets = true, .sharp_angle_deg = 20}, report);
  EXPECT_NEAR(calc_volume(m) / exact, 1, 5e-3);
  EXPECT_EQ(report.facet_pieces, 1);
}

TEST(curved, determinism) {
  SurfaceReport first, second;
  const auto a = make("same.off", make_sphere(0.05, 3), {.wall_m = 0.01, .nodes = 3000}, first);
  const auto b = make("same.off", make_sphere(0.05, 3), {.wall_m = 0.01, .nodes = 3000}, second);
  EXPECT_EQ(a.nodes_m, b.nodes_m);
  EXPECT_EQ(a.tets, b.tets);
}

}  // namespace
}  // namespace carillon::mesher
