// Seams between the faces of CAD programs, unused points, and numbers of bodies.
#include "precompute/mesher/seams.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "precompute/mesher/surface.hpp"
#include "tests/unit/precompute/mesher/surfaces.hpp"

namespace carillon::mesher {
namespace {

using namespace testing;
using Counts = std::array<std::array<int, 2>, 6>;

/// Divisions of the faces: equal and different on both sides of an edge.
constexpr Counts kMatching{{{3, 2}, {3, 2}, {2, 4}, {2, 4}, {4, 3}, {4, 3}}}, kDiffering{{{3, 2}, {5, 1}, {2, 7}, {1, 1}, {6, 4}, {9, 5}}};

/// A box from `corner` of faces with separate points, each displaced by up to `jitter` along each axis.
Polygons make_box_of_faces(const std::array<double, 3>& corner, const std::array<double, 3>& size, const Counts& counts, double jitter) {
  Polygons box;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> off(-jitter, jitter);
  for (std::size_t f = 0; f < 6; ++f) {
    const std::size_t axis = f / 2, is_far = f % 2, u = (axis + 1 + (1 - is_far)) % 3, v = (axis + 1 + is_far) % 3;
    const auto [n, m] = is_far ? counts[f] : std::array{counts[f][1], counts[f][0]};
    const auto first = static_cast<int>(box.points.size());
    for (int j = 0; j <= m; ++j)
      for (int i = 0; i <= n; ++i) {
        std::array<double, 3> p = corner;
        p[axis] += is_far ? size[axis] : 0;
        p[u] += size[u] * i / n;
        p[v] += size[v] * j / m;
        for (double& x : p) x += off(random);
        box.points.push_back(p);
      }
    for (int j = 0; j < m; ++j)
      for (int i = 0; i < n; ++i) {
        const int a = first + j * (n + 1) + i;
        box.faces.insert(box.faces.end(), {{a, a + 1, a + n + 2}, {a, a + n + 2, a + n + 1}});
      }
  }
  return box;
}

Polygons join(Polygons a, const Polygons& b) {
  const auto first = static_cast<int>(a.points.size());
  a.points.insert(a.points.end(), b.points.begin(), b.points.end());
  for (std::vector<int> face : b.faces) {
    for (int& v : face) v += first;
    a.faces.push_back(face);
  }
  return a;
}

/// A rectangle in the plane of this height, facing up or down.
Polygons make_sheet(double x, double y, double z, double low_x = 0, bool faces_down = false) {
  Polygons sheet{{{low_x, 0, z}, {low_x + x, 0, z}, {low_x + x, y, z}, {low_x, y, z}}, {{0, 1, 2}, {0, 2, 3}}};
  if (faces_down) sheet.faces = {{0, 2, 1}, {0, 3, 2}};
  return sheet;
}

TEST(seams, box_of_separate_faces) {
  for (const Counts& counts : {kMatching, kDiffering})
    for (const double jitter : {0.0, 1e-9, 5e-8, 1e-6}) {
      const Polygons box = make_box_of_faces({0, 0, 0}, {0.1, 0.06, 0.02}, counts, jitter);
      for (const auto& [name, text] :
           {std::pair{"seams.obj", to_obj(box)}, {"seams.off", to_off(box)}, {"seams.stl", to_binary_stl(box)}}) {
        SCOPED_TRACE(std::string(name) + ", points moved by " + std::to_string(1e9 * jitter) + " nm");
        const SurfaceInput input = read_input(write_text(name, text));
        EXPECT_EQ(count_bodies(input.surface), 1);
        EXPECT_LE(input.seams.widest, 2 * std::sqrt(3) * jitter + 1e-8);  // the rest is single precision
        SurfaceReport report;
        const RepairedSurface repaired = repair_surface(input.surface, {.surface = name}, report);
        EXPECT_TRUE(repaired.clean);
        EXPECT_FALSE(report.wrapped);
        EXPECT_EQ(report.holes_closed, 0);
        EXPECT_NEAR(calc_volume(repaired.surface), 1.2e-4, 1e-4 * 1.2e-4);
      }
    }
}

TEST(seams, report_of_joined_borders) {
  SurfaceReport report;
  mesh_surface(
      {.surface = write_text("s.obj", to_obj(make_box_of_faces({0, 0, 0}, {100, 60, 20}, kMatching, 1e-4))), .scale = 1e-3, .nodes = 500},
      report);
  EXPECT_EQ(report.sharp_curves, 12);
  EXPECT_NEAR(report.input_volume_m3, 1.2e-4, 1e-4 * 1.2e-4);
  EXPECT_EQ(report.seam_edges, 72);  // 4 x 3 (3 + 2 + 4) pieces of edges, from both sides
  ASSERT_FALSE(report.notes.empty());
  EXPECT_NE(report.notes.back().find("72 borders"), std::string::npos) << report.notes.back();
}

TEST(seams, thin_closed_plate) {
  for (const double thickness : {1e-5, 2e-6, 5e-7}) {  // of 0.1 m; seams are joined up to 3.5e-6
    TriangleSurface surface =
        read_surface(write_text("foil.obj", to_obj(make_box_of_faces({0, 0, 0}, {0.1, 0.06, thickness}, kMatching, 1e-10))));
    join_seams(surface);
    EXPECT_NEAR(calc_volume(surface), 0.006 * thickness, 2e-3 * 0.006 * thickness);
    EXPECT_EQ(count_bodies(surface), 1);
  }
}

TEST(seams, nearby_sheets) {
  const double gap = 2e-6;  // below the tolerance
  const SurfaceLook facing =
      look_at_surface(write_text("facing.obj", to_obj(join(make_sheet(0.1, 0.06, 0), make_sheet(0.1, 0.06, gap, 0, true)))));
  EXPECT_EQ(facing.openings, 2);
  EXPECT_EQ(facing.parts, 2);
  const SurfaceLook neighbours =
      look_at_surface(write_text("next.obj", to_obj(join(make_sheet(0.05, 0.06, 0), make_sheet(0.05, 0.06, 0, 0.05001)))));
  EXPECT_EQ(neighbours.parts, 2);  // 1e-4 of the size apart
  EXPECT_EQ(neighbours.seam_edges, 0);
}

TEST(seams, sheet_patches) {
  const SurfaceLook look =
      look_at_surface(write_text("two.obj", to_obj(join(make_sheet(0.05, 0.06, 0), make_sheet(0.05, 0.06, 2e-7, 0.05)))));
  EXPECT_EQ(look.parts, 1);
  EXPECT_EQ(look.openings, 1);
}

TEST(seams, body_count) {
  const auto count = [](const Polygons& polygons) { return look_at_surface(write_text("bodies.stl", to_binary_stl(polygons))).parts; };
  const auto make = [](double x, double size) { return make_box_of_faces({x, x, x}, {size, size, size}, kMatching, 0); };
  EXPECT_EQ(count(make(0, 1)), 1);
  EXPECT_EQ(count(join(make(0, 1), make(2, 1))), 2);
  EXPECT_EQ(count(join(make(0, 1), make(0.5, 1))), 1) << "they cut through each other";
  EXPECT_EQ(count(join(make(0, 4), make(1, 2))), 1) << "a cavity";
  EXPECT_EQ(count(join(join(make(0, 4), make(1, 2)), make(1.5, 0.5))), 2) << "a body in a cavity";
}

TEST(seams, unused_points) {
  Polygons box = make_box(0.1, 0.06, 0.02);
  box.points.insert(box.points.begin(), {5e5, 0, 0});
  for (auto& face : box.faces)
    for (int& v : face) ++v;
  const auto path = write_text("stray.off", to_off(box));
  const SurfaceLook look = look_at_surface(path);
  EXPECT_EQ(look.unused_points, 1);
  EXPECT_NEAR(look.extent[0], 0.1, 1e-12);
  SurfaceReport report;
  mesh_surface({.surface = path, .nodes = 500}, report);
  EXPECT_EQ(report.unused_points, 1);
  EXPECT_EQ(report.sharp_curves, 12);
  EXPECT_NEAR(report.input_volume_m3, 1.2e-4, 1e-12);
}

}  // namespace
}  // namespace carillon::mesher
