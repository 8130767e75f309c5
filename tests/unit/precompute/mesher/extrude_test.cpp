// Walls from skins: closed forms for volume, thickness and node positions, and refusals.
#include "precompute/mesher/extrude.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <random>

#include "precompute/mesh/check.hpp"
#include "precompute/mesh/curved.hpp"
#include "precompute/mesher/skin.hpp"
#include "precompute/mesher/surface.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/precompute/mesher/surfaces.hpp"

namespace carillon::mesher {
namespace {

using namespace testing;
constexpr double kPi = std::numbers::pi;

/// f(u, v) over a grid of nu x nv quads, each in two triangles; with `skip(i, j)` some are left out.
template <class F, class S>
Polygons make_grid(int nu, int nv, const F& f, const S& skip) {
  Polygons s;
  for (int j = 0; j <= nv; ++j)
    for (int i = 0; i <= nu; ++i) s.points.push_back(f(static_cast<double>(i) / nu, static_cast<double>(j) / nv));
  for (int j = 0; j < nv; ++j)
    for (int i = 0; i < nu; ++i) {
      if (skip(i, j)) continue;
      const int a = j * (nu + 1) + i;
      s.faces.insert(s.faces.end(), {{a, a + 1, a + nu + 2}, {a, a + nu + 2, a + nu + 1}});
    }
  return s;
}
template <class F>
Polygons make_grid(int nu, int nv, const F& f) {
  return make_grid(nu, nv, f, [](int, int) { return false; });
}

/// An open tube around z.
Polygons make_open_tube(double radius, double length, int n) {
  return make_grid(n, 4, [&](double u, double v) {
    return std::array{radius * std::cos(2 * kPi * u), radius * std::sin(2 * kPi * u), length * v};
  });
}

/// Two planes 60 x 100 mm that meet at x = 0 under this angle.
Polygons make_fold(double angle_deg) {
  const double half = angle_deg * kPi / 360;
  return make_grid(4, 8, [&](double u, double v) {
    const double s = 0.12 * (v - 0.5);
    return std::array{std::abs(s) * std::cos(half), s * std::sin(half), 0.1 * u};
  });
}

double calc_volume_of(const mesh::TetMesh& m) {
  double sum = 0;
  for (std::int64_t e = 0; e < m.tet_count(); ++e) {
    if (m.order == 2) {
      EXPECT_FALSE(mesh::is_folded(m, e)) << "element " << e;
      sum += mesh::calc_curved_volume(m, e);
      continue;
    }
    const auto t = m.tet(e);
    const Vec3 o = m.nodes_m[t[0]];
    const double volume = dot(cross(m.nodes_m[t[1]] - o, m.nodes_m[t[2]] - o), m.nodes_m[t[3]] - o) / 6;
    EXPECT_GT(volume, 0) << "element " << e;
    sum += volume;
  }
  return sum;
}

/// Every face belongs to one element or two, and nothing had to be repaired.
void expect_sound(const mesh::TetMesh& m) {
  std::map<std::array<std::int32_t, 2>, int> edges;  // of the boundary
  for (const auto& [f, owners] : find_face_owners(m)) {
    ASSERT_LE(owners.size(), 2);
    if (owners.size() == 1) ++edges[{f[0], f[1]}], ++edges[{f[1], f[2]}], ++edges[{f[0], f[2]}];
  }
  for (const auto& [edge, count] : edges) EXPECT_EQ(count, 2);
  mesh::TetMesh copy = m;
  const auto check = mesh::check_mesh(copy, "the extruded mesh");
  EXPECT_EQ(check.reoriented + check.unreferenced + check.welded + check.pinched_nodes + check.straightened, 0);
}

mesh::TetMesh make(const Polygons& s, SurfaceOptions options, SurfaceReport& report) {
  static int number = 0;
  options.surface = write_text("extruded" + std::to_string(number++) + ".off", to_off(s));
  if (options.order == 1) options.order = 0;
  return mesh_surface(options, report);
}

std::string find_refusal(const Polygons& s, const SurfaceOptions& options) {
  SurfaceReport report;
  return tests::catch_message<InputError>([&] { make(s, options, report); });
}

TEST(extrude, prism_conformity) {
  std::mt19937 random(7);
  for (const int layers : {1, 2, 3}) {
    const Polygons grid = make_grid(7, 5, [](double u, double v) { return std::array{u, v, 0.1 * std::sin(3 * u + v)}; });
    std::vector<std::int32_t> number(grid.points.size());
    for (std::size_t v = 0; v < number.size(); ++v) number[v] = static_cast<std::int32_t>(v);
    std::shuffle(number.begin(), number.end(), random);
    Skin skin;
    skin.surface.points.resize(grid.points.size());
    for (std::size_t v = 0; v < number.size(); ++v) skin.surface.points[number[v]] = grid.points[v];
    for (const auto& f : grid.faces) skin.surface.triangles.push_back({number[f[0]], number[f[1]], number[f[2]]});
    Wall wall;
    wall.layers = layers;
    wall.levels_m.assign(number.size(), {-0.02, 0.02});
    const Extruded made = extrude(skin, wall);
    expect_sound(made.mesh);
    EXPECT_EQ(made.mesh.tet_count(), static_cast<std::int64_t>(3 * layers * skin.surface.triangles.size()));
    // 4 (2 layers + 1) nodes a point, less what the border lacks.
    const auto edges = skin.surface.points.size() + skin.surface.triangles.size() - 1;
    EXPECT_EQ(made.mesh.nodes_m.size(), (2 * layers + 1) * (skin.surface.points.size() + edges));
    EXPECT_NEAR(calc_volume_of(made.mesh) / made.expected_volume_m3, 1, 0.02);
    EXPECT_EQ(made.mesh.node_sets.at("rim").size(), (2 * layers + 1) * 2 * 24);
  }
}

TEST(extrude, plate_sides) {
  const Polygons plate = make_grid(2, 2, [](double u, double v) { return std::array{0.1 * u, 0.09 * v, 0.0}; });
  for (const auto& [side, low] : {std::pair{Side::kMiddle, -0.0015}, std::pair{Side::kOutside, -0.003}, std::pair{Side::kInside, 0.0}}) {
    SurfaceReport report;
    const auto m = make(plate, {.wall_m = 0.003, .side = side, .edge_m = 0.012}, report);
    expect_sound(m);
    EXPECT_EQ(report.method, Method::kExtrusion);
    EXPECT_EQ(m.order, 2);
    EXPECT_NEAR(calc_volume_of(m), 0.1 * 0.09 * 0.003, 1e-17);
    double min = 1, max = -1;
    for (const Vec3& p : m.nodes_m) min = std::min(min, p[2]), max = std::max(max, p[2]);
    EXPECT_NEAR(min, low, 1e-15);
    EXPECT_NEAR(max, low + 0.003, 1e-15);
    EXPECT_NEAR(report.wall_min_m, 0.003, 1e-15);
    EXPECT_NEAR(report.wall_max_m, 0.003, 1e-15);
    EXPECT_EQ(report.straightened_tets, 0);
    for (const char* set : {"inner", "outer", "rim"}) EXPECT_GT(m.node_sets.at(set).size(), 20u) << set;
    for (const std::int32_t v : m.node_sets.at("outer")) EXPECT_NEAR(m.nodes_m[v][2], low + 0.003, 1e-15);
    for (const std::int32_t v : m.node_sets.at("rim")) {
      const Vec3& p = m.nodes_m[v];
      EXPECT_LT(std::min({p[0], 0.1 - p[0], p[1], 0.09 - p[1]}), 1e-12);
    }
  }
}

TEST(extrude, hollow_ball) {
  const double radius = 0.05, wall = 0.002;
  SurfaceReport report;
  const auto m = make(make_sphere(radius, 4), {.wall_m = wall, .edge_m = 0.008}, report);
  expect_sound(m);
  EXPECT_EQ(report.method, Method::kExtrusion);
  EXPECT_FALSE(report.reason.empty());
  EXPECT_FALSE(m.node_sets.contains("rim"));
  EXPECT_NEAR(calc_volume_of(m) / (4 * kPi / 3 * (std::pow(radius, 3) - std::pow(radius - wall, 3))), 1, 1e-4);
  EXPECT_NEAR(report.volume_m3 / report.expected_volume_m3, 1, 5e-4);
  for (const std::int32_t v : m.node_sets.at("outer")) EXPECT_NEAR(norm(m.nodes_m[v]), radius, 2e-4 * radius);
  for (const std::int32_t v : m.node_sets.at("inner")) EXPECT_NEAR(norm(m.nodes_m[v]), radius - wall, 2e-4 * radius);
}

TEST(extrude, faceted_open_tube) {
  const double radius = 0.03, length = 0.1, wall = 0.002;
  for (const auto& [side, middle] :
       {std::pair{Side::kAutomatic, radius}, std::pair{Side::kOutside, radius - wall / 2}, std::pair{Side::kInside, radius + wall / 2}}) {
    SurfaceReport report;
    const auto m = make(make_open_tube(radius, length, 24), {.wall_m = wall, .side = side, .edge_m = 0.008}, report);
    expect_sound(m);
    EXPECT_NEAR(calc_volume_of(m) / (2 * kPi * middle * wall * length), 1, 5e-4);
    for (const auto& [set, at] : {std::pair{"outer", middle + wall / 2}, std::pair{"inner", middle - wall / 2}})
      for (const std::int32_t v : m.node_sets.at(set)) EXPECT_NEAR(std::hypot(m.nodes_m[v][0], m.nodes_m[v][1]), at, 3e-4 * radius) << set;
  }
}

TEST(extrude, openings_and_holes) {
  // Both take less than a twentieth of the diagonal.
  const Polygons tube = make_open_tube(0.0115, 0.505, 48);
  SurfaceReport report;
  const auto open = make(tube, {.wall_m = 0.002, .edge_m = 0.01}, report);
  EXPECT_EQ(report.holes_closed, 0);
  EXPECT_EQ(report.shells, 1);
  EXPECT_NEAR(calc_volume_of(open) / (2 * kPi * 0.0115 * 0.002 * 0.505), 1, 0.01);
  SurfaceReport capped;
  make(tube, {.wall_m = 0.002, .edge_m = 0.01, .close_holes = 0.1}, capped);
  EXPECT_EQ(capped.holes_closed, 2);
  EXPECT_EQ(capped.shells, 2);

  Polygons ball = make_sphere(0.05, 4);
  std::erase_if(ball.faces, [&](const std::vector<int>& f) {  // not seen by a scanner
    return std::all_of(f.begin(), f.end(),
                       [&](int v) { return std::hypot(ball.points[v][0] - 0.05, ball.points[v][1], ball.points[v][2]) < 0.007; });
  });
  SurfaceReport scanned;
  make(ball, {.wall_m = 0.003, .nodes = 6000}, scanned);
  EXPECT_EQ(scanned.holes_closed, 1);
  EXPECT_EQ(scanned.shells, 2);
}

TEST(extrude, mitred_folds) {
  const double wall = 0.004;
  for (const double angle : {175.0, 120.0, 90.0, 60.0, 40.0})
    for (const auto& [side, sign] : {std::pair{Side::kMiddle, 0}, std::pair{Side::kOutside, -1}, std::pair{Side::kInside, 1}}) {
      SurfaceReport report;
      const auto m = make(make_fold(angle), {.wall_m = wall, .side = side, .edge_m = 0.012}, report);
      expect_sound(m);
      // The triangles between the ends of both walls and the mitre, whose side is cot(angle / 2) times the wall. The sheet is turned out.
      const double mitre = wall * wall / std::tan(angle * kPi / 360) * 0.1;
      const double volume = calc_volume_of(m), plain = 0.12 * 0.1 * wall;
      if (sign == 0)
        EXPECT_NEAR(volume, plain, 1e-12) << angle;
      else
        EXPECT_NEAR(std::abs(volume - plain), mitre, 1e-3 * mitre + 1e-12) << angle;
      EXPECT_NEAR(report.volume_m3 / report.expected_volume_m3, 1, 0.02) << angle;
      EXPECT_NEAR(report.wall_min_m, wall, 1e-5 * wall) << angle;
      EXPECT_NEAR(report.wall_max_m, wall, 1e-5 * wall) << angle;
    }
}

TEST(extrude, node_counts_and_determinism) {
  for (const std::int64_t nodes : {800, 3000, 12000}) {
    SurfaceReport report;
    const auto m = make(make_open_tube(0.03, 0.1, 32), {.wall_m = 0.001, .nodes = nodes}, report);
    EXPECT_NEAR(static_cast<double>(m.nodes_m.size()) / static_cast<double>(nodes), 1, 0.1);
    SurfaceReport again;
    const auto n = make(make_open_tube(0.03, 0.1, 32), {.wall_m = 0.001, .nodes = nodes}, again);
    EXPECT_EQ(m.nodes_m, n.nodes_m);
    EXPECT_EQ(m.tets, n.tets);
  }
}

TEST(extrude, two_sided_surface) {
  // A cup, turned: sides of 2 mm, a bottom of 3 mm.
  const std::vector<std::array<double, 2>> profile{{0, 0},        {0.03, 0},      {0.03, 0.025},  {0.03, 0.05},
                                                   {0.028, 0.05}, {0.028, 0.026}, {0.028, 0.003}, {0, 0.003}};
  SurfaceReport report;
  const auto m = make(make_lathe(profile, 32, Cut::kDiagonal), {.edge_m = 0.005}, report);
  expect_sound(m);
  EXPECT_EQ(report.method, Method::kExtrusion);
  const double exact = kPi * (0.03 * 0.03 * 0.05 - 0.028 * 0.028 * 0.047);
  EXPECT_NEAR(calc_volume_of(m) / exact, 1, 2e-3);
  EXPECT_NEAR(report.wall_min_m, 0.002, 5e-5);  // next to the thicker bottom the columns lean
  EXPECT_NEAR(report.wall_max_m, 0.003, 2e-4);
  for (const std::int32_t v : m.node_sets.at("rim")) EXPECT_NEAR(m.nodes_m[v][2], 0.05, 1e-6);
}

TEST(extrude, automatic_method) {
  const Polygons ball = make_sphere(0.05, 4);
  SurfaceReport report;
  make(ball, {.wall_m = 0.004, .nodes = 9000}, report);  // edges of 7 mm
  EXPECT_EQ(report.method, Method::kExtrusion);
  EXPECT_NE(report.reason.find("thinner than the elements are long"), std::string::npos) << report.reason;
  SurfaceReport thick;
  make(ball, {.wall_m = 0.012, .nodes = 9000}, thick);
  EXPECT_EQ(thick.method, Method::kDelaunay);
  EXPECT_NE(thick.reason.find("not longer than the wall is thick"), std::string::npos) << thick.reason;
  // What is asked for is done: linear elements need the volume meshed.
  SurfaceReport linear;
  SurfaceOptions options{.surface = write_text("linear.off", to_off(ball)), .wall_m = 0.004, .nodes = 4000, .order = 1};
  EXPECT_EQ(mesh_surface(options, linear).order, 1);
  EXPECT_EQ(linear.method, Method::kDelaunay);
}

TEST(extrude, holes_at_a_rim) {
  const auto tube = [](double u, double v) { return std::array{0.03 * std::cos(2 * kPi * u), 0.03 * std::sin(2 * kPi * u), 0.1 * v}; };
  const Polygons holed = make_grid(48, 24, tube, [](int i, int j) { return (j == 1 || j == 2) && i % 8 < 2; });
  SurfaceReport report;
  const auto m = make(holed, {.wall_m = 0.002, .edge_m = 0.006}, report);
  expect_sound(m);
  // A tube with six holes: its skin is a sphere with seven handles. V - E + F = 2 - 2 * 7.
  const mesh::Surface skin = mesh::extract_boundary(m);
  EXPECT_EQ(static_cast<std::int64_t>(skin.nodes.size()) - static_cast<std::int64_t>(skin.triangles.size()) / 2, 2 - 2 * 7);
  const double hole = (2 * kPi * 0.03 / 24) * (0.1 / 12);
  EXPECT_NEAR(calc_volume_of(m) / (0.002 * (2 * kPi * 0.03 * 0.1 - 6 * hole)), 1, 2e-3);
}

TEST(extrude, refusals) {
  const auto plate = [](double u, double v) { return std::array{0.1 * u, 0.1 * v, 0.0}; };
  Polygons tee = make_grid(4, 4, plate), crossed = make_grid(5, 5, plate);
  const Polygons post = make_grid(4, 2, [](double u, double v) { return std::array{0.1 * u, 0.05, 0.05 * v}; });
  const Polygons blade = make_grid(3, 3, [](double u, double v) { return std::array{0.1 * u, 0.047, 0.1 * v - 0.05}; });
  for (const auto& [to, from] : {std::pair{&tee, &post}, std::pair{&crossed, &blade}}) {
    const int first = static_cast<int>(to->points.size());
    to->points.insert(to->points.end(), from->points.begin(), from->points.end());
    for (auto face : from->faces) {
      for (int& v : face) v += first;
      to->faces.push_back(face);
    }
  }
  const Polygons spiral = make_grid(96, 6, [](double u, double v) {
    const double r = 0.02 + 0.003 * u;
    return std::array{r * std::cos(4 * kPi * u), r * std::sin(4 * kPi * u), 0.04 * v};
  });
  const auto sheet = [](double wall) { return SurfaceOptions{.wall_m = wall}; };
  const auto has = [](const std::string& text, const std::string& word) {
    EXPECT_NE(text.find(word), std::string::npos) << "no '" << word << "' in: " << text;
  };
  has(find_refusal(tee, sheet(0.002)), "T-junction");
  has(find_refusal(tee, sheet(0.002)), "0.05, 0)");
  has(find_refusal(crossed, sheet(0.002)), "runs into itself at (");
  has(find_refusal(spiral, sheet(0.002)), "closer there than the wall is thick");
  has(find_refusal(make_fold(5), sheet(0.002)), "folded there to 5 degrees");
  has(find_refusal(make_open_tube(0.01, 0.03, 24), {.wall_m = 0.0195, .edge_m = 0.003}), "too thick for the bend");
  has(find_refusal(make_grid(2, 2, plate), {}), "--wall");
  has(find_refusal(make_sphere(0.05, 3), {.method = Method::kExtrusion}), "give --wall");
}

}  // namespace
}  // namespace carillon::mesher
