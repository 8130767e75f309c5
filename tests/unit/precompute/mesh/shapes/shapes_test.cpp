// Parametric bodies against closed forms and independent quality measures.
#include "precompute/mesh/shapes/shapes.hpp"

#include <fmt/core.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <set>

#include "precompute/mesh/check.hpp"
#include "tests/support/catch_message.hpp"
#include "tests/unit/precompute/mesh/shapes/quality.hpp"

namespace carillon::shapes::tests {
namespace {

constexpr double kPi = std::numbers::pi;
using Values = std::map<std::string, double>;

mesh::TetMesh make(const std::string& shape, const Values& dimensions, int order, long long nodes) {
  ShapeOptions options;
  options.shape = shape;
  options.dimensions = dimensions;
  options.order = order;
  options.target_nodes = nodes;
  return make_shape(options);
}

double calc_shell_volume(double outer, double inner) { return 4.0 / 3.0 * kPi * (std::pow(outer, 3) - std::pow(inner, 3)); }

struct Case {
  std::string shape;
  Values dimensions;
  double volume_m3;
  double min_dihedral_deg;  // at 10,000 nodes, either order
  int euler;                // of the body's boundary surface: 2 a sphere, 0 a torus, 4 two spheres
};

const std::vector<Case>& get_cases() {
  static const std::vector<Case> cases{
      {"bar", {}, 0.3 * 0.02 * 0.01, 30.0, 2},
      {"bar", {{"length", 0.1}, {"width", 0.1}, {"thickness", 0.1}}, 1e-3, 40.0, 2},
      {"bar", {{"length", 2.0}, {"width", 0.01}, {"thickness", 0.01}}, 2e-4, 15.0, 2},
      {"tube", {}, kPi * 0.3 * (0.0125 * 0.0125 - 0.0115 * 0.0115), 9.0, 0},
      {"tube", {{"length", 0.02}, {"wall", 0.004}}, kPi * 0.02 * (0.0125 * 0.0125 - 0.0085 * 0.0085), 30.0, 0},
      {"tube", {{"length", 0.03}, {"wall", 0.011}}, kPi * 0.03 * (0.0125 * 0.0125 - 0.0015 * 0.0015), 10.0, 0},
      {"plate", {}, 0.3 * 0.2 * 0.005, 25.0, 2},
      {"sphere", {}, calc_shell_volume(0.05, 0.0), 30.0, 2},
      {"sphere", {{"radius", 2.0}}, calc_shell_volume(2.0, 0.0), 30.0, 2},
      {"sphere", {{"wall", 0.005}}, calc_shell_volume(0.05, 0.045), 25.0, 4},
      {"bowl", {}, 0.5 * calc_shell_volume(0.08, 0.076), 20.0, 2},
      {"bowl", {{"opening-angle", 60.0}, {"wall", 0.008}}, 0.5 * (1.0 - std::cos(kPi / 6)) * calc_shell_volume(0.08, 0.072), 20.0, 2},
      {"bowl", {{"opening-angle", 300.0}}, 0.5 * (1.0 - std::cos(kPi * 5 / 6)) * calc_shell_volume(0.08, 0.076), 15.0, 2},
      {"bowl", {{"wall", 0.06}}, 0.5 * calc_shell_volume(0.08, 0.02), 20.0, 2},
      {"box", {}, 0.1 * 0.08 * 0.06, 38.0, 2},
      {"hollow-box", {}, 0.2 * 0.15 * 0.1 - 0.19 * 0.14 * 0.09, 20.0, 4},
      {"hollow-box", {{"wall", 0.03}}, 0.2 * 0.15 * 0.1 - 0.14 * 0.09 * 0.04, 30.0, 4},
      {"cylinder", {}, kPi * 0.01 * 0.01 * 0.3, 20.0, 2},
      {"cylinder", {{"length", 0.1}, {"radius", 0.05}}, kPi * 0.05 * 0.05 * 0.1, 25.0, 2},
      {"disc", {}, kPi * 0.05 * 0.05 * 0.003, 20.0, 2},
      {"disc", {{"radius", 0.012}, {"thickness", 0.002}}, kPi * 0.012 * 0.012 * 0.002, 20.0, 2},
      {"ring", {}, 2.0 * kPi * kPi * 0.03 * 0.003 * 0.003, 20.0, 0},
      {"ring", {{"radius", 0.03}, {"thickness", 0.04}}, 2.0 * kPi * kPi * 0.03 * 0.02 * 0.02, 10.0, 0},
      {"cone", {}, kPi / 3.0 * 0.03 * 0.03 * 0.08, 12.0, 2},
      {"cone", {{"height", 0.03}}, kPi / 3.0 * 0.03 * 0.03 * 0.03, 15.0, 2},
      {"cone", {{"top-radius", 0.01}}, kPi / 3.0 * (0.03 * 0.03 + 0.03 * 0.01 + 0.01 * 0.01) * 0.08, 15.0, 2}};
  return cases;
}

std::string describe(const Case& body, int order) {
  std::string text = fmt::format("{} order {}", body.shape, order);
  for (const auto& [name, value] : body.dimensions) text += fmt::format(" {}={}", name, value);
  return text;
}

TEST(Shapes, conformity_and_quality) {
  for (const Case& body : get_cases()) {
    for (int order : {1, 2}) {
      SCOPED_TRACE(describe(body, order));
      const mesh::TetMesh mesh = make(body.shape, body.dimensions, order, 10000);
      const Quality quality = measure(mesh);
      EXPECT_TRUE(quality.conforming);
      EXPECT_GT(quality.min_corner_volume, 0.0);
      EXPECT_EQ(quality.unused_nodes, 0);
      EXPECT_EQ(quality.repeated_nodes, 0);
      EXPECT_GE(quality.min_dihedral_deg, body.min_dihedral_deg);
      EXPECT_LE(quality.max_dihedral_deg, body.shape == "cone" ? 155.0 : 140.0);  // the point of a cone is six tetrahedra round one edge
      EXPECT_GT(quality.min_jacobian_ratio, 0.25);
      EXPECT_EQ(mesh.order, order);
      EXPECT_EQ(mesh.regions.size(), static_cast<std::size_t>(mesh.tet_count()));
    }
  }
}

TEST(Shapes, boundary_topology) {
  for (const Case& body : get_cases()) {
    SCOPED_TRACE(describe(body, 1));
    const mesh::TetMesh mesh = make(body.shape, body.dimensions, 1, 3000);
    std::map<std::array<int, 3>, int> faces;
    for (std::int64_t e = 0; e < mesh.tet_count(); ++e) {
      for (const auto& face : mesh::kFaces) {
        std::array<int, 3> key{mesh.tet(e)[face[0]], mesh.tet(e)[face[1]], mesh.tet(e)[face[2]]};
        std::sort(key.begin(), key.end());
        ++faces[key];
      }
    }
    std::set<int> vertices;
    long long triangles = 0;
    for (const auto& [face, count] : faces) {
      if (count != 1) continue;
      ++triangles;
      vertices.insert(face.begin(), face.end());
    }
    EXPECT_EQ(static_cast<long long>(vertices.size()) - triangles / 2, body.euler);  // V - E + F with E = 3 F / 2
  }
}

TEST(Shapes, node_count) {
  for (const Case& body : get_cases()) {
    for (int order : {1, 2}) {
      SCOPED_TRACE(describe(body, order));
      for (long long nodes : {700, 1000, 1500, 2300, 3600, 5500, 9000, 15000, 37000}) {
        const double count = static_cast<double>(make(body.shape, body.dimensions, order, nodes).nodes_m.size());
        EXPECT_NEAR(count / static_cast<double>(nodes), 1.0, 0.1) << nodes << " nodes asked";
      }
    }
  }
}

TEST(Shapes, layers_through_the_least_thickness) {
  const std::vector<std::pair<std::string, Values>> bodies{
      {"plate", {{"length", 0.24}, {"width", 0.16}, {"thickness", 0.003}}},
      {"disc", {{"radius", 0.06}, {"thickness", 0.0015}}},
      {"tube", {{"length", 0.12}, {"outer-radius", 0.02}, {"wall", 0.002}}},
      {"bowl", {{"outer-radius", 0.07}, {"wall", 0.004}}},
      {"sphere", {{"radius", 0.06}, {"wall", 0.003}}},
      {"hollow-box", {{"length", 0.09}, {"width", 0.07}, {"height", 0.05}, {"wall", 0.005}}}};
  for (const auto& [shape, dimensions] : bodies)
    for (const int layers : {1, 2, 3}) {
      const ShapeOptions options{.shape = shape, .dimensions = dimensions, .order = 2, .target_nodes = 9000, .layers = layers};
      const mesh::TetMesh mesh = make_shape(options);
      EXPECT_NEAR(static_cast<double>(mesh.nodes_m.size()), 9000, 900) << shape;
      // Layers have vertices inside the wall, which no face of the surface has; one layer has none.
      const mesh::Surface surface = mesh::extract_boundary(mesh);
      const std::set<std::int32_t> outer(surface.nodes.begin(), surface.nodes.end());
      std::set<std::int32_t> corners;
      for (std::size_t at = 0; at < mesh.tets.size(); at += 10) corners.insert(&mesh.tets[at], &mesh.tets[at] + 4);
      const auto inside = std::ranges::count_if(corners, [&](std::int32_t node) { return !outer.contains(node); });
      const double all = static_cast<double>(corners.size());
      if (layers == 1) {
        EXPECT_EQ(inside, 0) << shape;
      }
      if (layers > 1) {
        EXPECT_NEAR(static_cast<double>(inside) / all, (layers - 1.0) / (layers + 1.0), 0.12) << shape << " " << layers;
      }
    }
}

TEST(Shapes, quadratic_volumes) {
  for (const Case& body : get_cases()) {
    SCOPED_TRACE(describe(body, 2));
    const bool flat = body.shape == "bar" || body.shape == "plate" || body.shape == "box" || body.shape == "hollow-box";
    const Quality quality = measure(make(body.shape, body.dimensions, 2, 10000));
    EXPECT_NEAR(quality.volume_m3 / body.volume_m3, 1.0, flat ? 1e-12 : 3e-4);
  }
}

TEST(Shapes, volume_convergence_order) {
  const double bowl = 0.5 * calc_shell_volume(0.08, 0.06);
  const double tube = kPi * 0.03 * (0.02 * 0.02 - 0.01 * 0.01);
  const double ball = calc_shell_volume(0.05, 0.0);
  struct Body {
    std::string shape;
    Values dimensions;
    double volume, edge;
  };
  for (const Body& body : {Body{"sphere", {}, ball, 0.0125}, Body{"bowl", {{"wall", 0.02}}, bowl, 0.01},
                           Body{"tube", {{"length", 0.03}, {"outer-radius", 0.02}, {"wall", 0.01}}, tube, 0.005}}) {
    for (int order : {1, 2}) {
      std::array<double, 2> errors{};
      for (int level = 0; level < 2; ++level) {
        ShapeOptions options{.shape = body.shape, .dimensions = body.dimensions, .order = order};
        options.edge_m = body.edge / (level + 1.0);
        errors[level] = std::abs(measure(make_shape(options)).volume_m3 / body.volume - 1.0);
      }
      const double rate = std::log2(errors[0] / errors[1]);
      EXPECT_NEAR(rate, 2.0 * order, 0.5) << body.shape << " order " << order << ": " << errors[0] << " -> " << errors[1];
    }
  }
}

// Nodes of all boundary faces, including mid-side nodes.
std::set<int> find_boundary_nodes(const mesh::TetMesh& mesh) {
  std::map<std::array<int, 3>, std::array<int, 6>> once;
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e) {
    const auto tet = mesh.tet(e);
    for (const auto& face : mesh::kFaces) {
      std::array<int, 3> key{tet[face[0]], tet[face[1]], tet[face[2]]};
      std::array<int, 6> nodes{tet[face[0]], tet[face[1]], tet[face[2]], 0, 0, 0};
      for (int i = 0; i < 3; ++i) {
        for (int edge = 0; edge < 6; ++edge) {
          const auto [a, b] = mesh::kEdges[edge];
          const int p = face[i], q = face[(i + 1) % 3];
          if ((a == p && b == q) || (a == q && b == p)) nodes[3 + i] = tet[4 + edge];
        }
      }
      std::sort(key.begin(), key.end());
      if (!once.try_emplace(key, nodes).second) once.erase(key);
    }
  }
  std::set<int> result;
  for (const auto& [key, nodes] : once) result.insert(nodes.begin(), nodes.end());
  return result;
}

TEST(Shapes, sphere_boundary_nodes) {
  for (long long nodes : {700, 3000, 11000}) {
    const mesh::TetMesh mesh = make("sphere", {}, 2, nodes);
    const std::set<int> boundary = find_boundary_nodes(mesh);
    EXPECT_GT(boundary.size(), 100u);
    for (int node : boundary) ASSERT_NEAR(norm(mesh.nodes_m[node]) / 0.05, 1.0, 1e-12);
    EXPECT_EQ(std::vector<std::int32_t>(boundary.begin(), boundary.end()), mesh.node_sets.at("surface"));
  }
}

TEST(Shapes, tube_boundary_nodes) {
  const mesh::TetMesh mesh = make("tube", {}, 2, 8000);
  int inner = 0, outer = 0;
  for (int node : find_boundary_nodes(mesh)) {
    const double radius = std::hypot(mesh.nodes_m[node][1], mesh.nodes_m[node][2]);
    const bool on_inner = std::abs(radius / 0.0115 - 1.0) < 1e-12, on_outer = std::abs(radius / 0.0125 - 1.0) < 1e-12;
    const bool on_end = std::abs(std::abs(mesh.nodes_m[node][0]) - 0.15) < 1e-13;
    ASSERT_TRUE(on_inner || on_outer || on_end) << "node " << node << " at radius " << radius;
    inner += on_inner;
    outer += on_outer;
  }
  EXPECT_GT(inner, 1000);
  EXPECT_EQ(inner, outer);
  EXPECT_EQ(static_cast<int>(mesh.node_sets.at("inner").size()), inner);
  EXPECT_EQ(static_cast<int>(mesh.node_sets.at("outer").size()), outer);
}

TEST(Shapes, bowl_boundary_nodes) {
  for (double opening : {100.0, 180.0, 250.0}) {
    const mesh::TetMesh mesh = make("bowl", {{"opening-angle", opening}}, 2, 8000);
    const double cosine = -std::cos(opening * kPi / 360.0);
    std::size_t rim = 0;
    for (int node : find_boundary_nodes(mesh)) {
      const double radius = norm(mesh.nodes_m[node]);
      const bool on_sphere = std::abs(radius / 0.08 - 1.0) < 1e-12 || std::abs(radius / 0.076 - 1.0) < 1e-12;
      const bool on_rim = std::abs(mesh.nodes_m[node][2] / radius - cosine) < 1e-12;
      ASSERT_TRUE(on_sphere || on_rim) << "node " << node << " at radius " << radius;
      rim += on_rim;
    }
    EXPECT_EQ(mesh.node_sets.at("rim").size(), rim);
  }
}

TEST(Shapes, round_section_boundary_nodes) {
  struct Round {
    std::string shape;
    Values dimensions;
    std::vector<std::pair<std::string, std::function<double(const Vec3&)>>> faces;  // how far off [m]
  };
  const auto off = [](double x, double wanted) { return std::abs(x - wanted); };
  const std::vector<Round> bodies{
      {"cylinder",
       {},
       {{"end-min", [&](const Vec3& x) { return off(x[0], -0.15); }},
        {"end-max", [&](const Vec3& x) { return off(x[0], 0.15); }},
        {"side", [&](const Vec3& x) { return off(std::hypot(x[1], x[2]), 0.01); }}}},
      {"disc",
       {},
       {{"z-min", [&](const Vec3& x) { return off(x[2], -0.0015); }},
        {"z-max", [&](const Vec3& x) { return off(x[2], 0.0015); }},
        {"edge", [&](const Vec3& x) { return off(std::hypot(x[0], x[1]), 0.05); }}}},
      {"ring", {}, {{"surface", [&](const Vec3& x) { return off(std::hypot(std::hypot(x[0], x[1]) - 0.03, x[2]), 0.003); }}}},
      {"cone",
       {},
       {{"base", [&](const Vec3& x) { return off(x[2], -0.04); }},
        {"top",
         [&](const Vec3& x) {
           return norm(x - Vec3{0, 0, 0.04});
         }},
        {"side", [&](const Vec3& x) { return off(std::hypot(x[0], x[1]), 0.03 * (0.04 - x[2]) / 0.08); }}}},
      {"cone",
       {{"top-radius", 0.01}},
       {{"base", [&](const Vec3& x) { return off(x[2], -0.04); }},
        {"top", [&](const Vec3& x) { return off(x[2], 0.04); }},
        {"side", [&](const Vec3& x) { return off(std::hypot(x[0], x[1]), 0.01 + 0.02 * (0.04 - x[2]) / 0.08); }}}}};
  for (const Round& body : bodies) {
    for (const long long nodes : {900, 6000}) {
      SCOPED_TRACE(fmt::format("{} {} nodes", body.shape, nodes));
      const mesh::TetMesh mesh = make(body.shape, body.dimensions, 2, nodes);
      std::map<std::string, std::vector<std::int32_t>> expected;
      for (const int node : find_boundary_nodes(mesh)) {
        bool is_on_a_face = false;
        for (const auto& [name, distance] : body.faces) {
          if (distance(mesh.nodes_m[node]) > 1e-14) continue;
          expected[name].push_back(node);
          is_on_a_face = true;
        }
        ASSERT_TRUE(is_on_a_face) << "node " << node;
      }
      for (const auto& [name, distance] : body.faces) {
        std::vector<std::int32_t> set = mesh.node_sets.at(name);
        std::sort(set.begin(), set.end());
        EXPECT_EQ(set, expected[name]) << name;
      }
    }
  }
}

TEST(Shapes, node_set_contents) {
  const std::array<double, 3> edges{0.2, 0.15, 0.1};
  for (int order : {1, 2}) {
    for (const char* shape : {"box", "hollow-box"}) {
      const mesh::TetMesh mesh = make(shape, {{"length", 0.2}, {"width", 0.15}, {"height", 0.1}}, order, 3000);
      for (int axis = 0; axis < 3; ++axis) {
        for (int side : {-1, 1}) {
          const std::string name = fmt::format("{}-{}", "xyz"[axis], side < 0 ? "min" : "max");
          std::vector<std::int32_t> expected;
          for (std::size_t n = 0; n < mesh.nodes_m.size(); ++n) {
            if (mesh.nodes_m[n][axis] == side * 0.5 * edges[axis]) expected.push_back(static_cast<std::int32_t>(n));
          }
          EXPECT_GT(expected.size(), 20u);
          EXPECT_EQ(mesh.node_sets.at(name), expected) << shape << " " << name;
        }
      }
    }
  }
  const mesh::TetMesh plate = make("plate", {}, 2, 3000);
  std::vector<std::int32_t> expected;
  for (std::size_t n = 0; n < plate.nodes_m.size(); ++n) {
    if (std::abs(plate.nodes_m[n][0]) == 0.15 || std::abs(plate.nodes_m[n][1]) == 0.1) expected.push_back(static_cast<std::int32_t>(n));
  }
  EXPECT_EQ(plate.node_sets.at("edges"), expected);
  const mesh::TetMesh tube = make("tube", {}, 2, 3000);
  for (auto node : tube.node_sets.at("end-min")) EXPECT_EQ(tube.nodes_m[node][0], -0.15);
  for (auto node : tube.node_sets.at("end-max")) EXPECT_EQ(tube.nodes_m[node][0], 0.15);
}

TEST(Shapes, declared_node_sets) {
  for (const Shape& shape : get_shapes()) {
    if (shape.name == "sphere") continue;  // its sets depend on the wall
    const mesh::TetMesh mesh = make(shape.name, {}, 1, 2000);
    EXPECT_EQ(mesh.node_sets.size(), shape.node_sets.size());
    for (const std::string& name : shape.node_sets) EXPECT_TRUE(mesh.node_sets.contains(name)) << shape.name << " " << name;
  }
}

TEST(Shapes, square_bar_symmetry) {
  const mesh::TetMesh mesh = make_box({0.4, 0.1, 0.1}, {8, 2, 2});
  std::set<std::set<std::array<long, 3>>> tets, mirrored, turned;
  const auto key = [](double v) { return std::lround(v * 1e6); };
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e) {
    std::set<std::array<long, 3>> a, b, c;
    for (auto n : mesh.tet(e)) {
      const Vec3& x = mesh.nodes_m[n];
      a.insert({key(x[0]), key(x[1]), key(x[2])});
      b.insert({key(x[0]), key(-x[1]), key(x[2])});
      c.insert({key(x[0]), key(x[2]), key(x[1])});
    }
    tets.insert(a);
    mirrored.insert(b);
    turned.insert(c);
  }
  EXPECT_EQ(tets, mirrored);
  EXPECT_EQ(tets, turned);
}

TEST(Shapes, edge_length) {
  for (const char* shape : {"box", "sphere", "bowl"}) {
    ShapeOptions options{.shape = shape};
    options.edge_m = 0.008;
    const mesh::TetMesh mesh = make_shape(options);
    double sum = 0.0;
    long long count = 0;
    for (std::int64_t e = 0; e < mesh.tet_count(); ++e) {
      for (const auto& [a, b] : mesh::kEdges) {
        sum += norm(mesh.nodes_m[mesh.tet(e)[a]] - mesh.nodes_m[mesh.tet(e)[b]]);
        ++count;
      }
    }
    EXPECT_NEAR(sum / static_cast<double>(count) / 0.008, 1.15, 0.3) << shape;  // diagonals are longer
  }
}

TEST(Shapes, determinism) {
  const mesh::TetMesh a = make("bowl", {}, 2, 3000), b = make("bowl", {}, 2, 3000);
  EXPECT_EQ(a.nodes_m, b.nodes_m);
  EXPECT_EQ(a.tets, b.tets);
}

TEST(Shapes, extreme_bodies) {
  struct Extreme {
    std::string shape;
    Values dimensions;
  };
  for (const Extreme& body :
       {Extreme{"tube", {{"wall", 0.00005}}}, Extreme{"tube", {{"wall", 0.0124}}}, Extreme{"tube", {{"length", 0.0005}}},
        Extreme{"bowl", {{"wall", 0.0002}}}, Extreme{"bowl", {{"wall", 0.079}}}, Extreme{"bowl", {{"opening-angle", 20.0}, {"wall", 0.04}}},
        Extreme{"bowl", {{"opening-angle", 340.0}}}, Extreme{"sphere", {{"wall", 0.0001}}}, Extreme{"hollow-box", {{"wall", 0.0001}}},
        Extreme{"hollow-box", {{"wall", 0.0499}}}, Extreme{"plate", {{"thickness", 0.00002}}},
        Extreme{"cylinder", {{"length", 1.0}, {"radius", 0.0025}}}, Extreme{"disc", {{"radius", 0.012}, {"thickness", 0.0002}}},
        Extreme{"ring", {{"thickness", 0.0006}}},

        Extreme{"cone", {{"height", 0.003}}}, Extreme{"cone", {{"height", 0.6}}}, Extreme{"cone", {{"top-radius", 0.0001}}},
        Extreme{"cone", {{"top-radius", 0.2}}}, Extreme{"cone", {{"top-radius", 0.03}}}}) {
    for (int order : {1, 2}) {
      for (long long nodes : {800, 12000}) {
        SCOPED_TRACE(fmt::format("{} {} order {} nodes {}", body.shape, body.dimensions.begin()->first, order, nodes));
        const mesh::TetMesh mesh = make(body.shape, body.dimensions, order, nodes);
        const Quality quality = measure(mesh);
        EXPECT_TRUE(quality.conforming);
        EXPECT_GT(quality.min_corner_volume, 0.0);
        EXPECT_GT(quality.min_jacobian_ratio, 0.0);
        EXPECT_NEAR(static_cast<double>(mesh.nodes_m.size()) / static_cast<double>(nodes), 1.0, 0.1);
      }
    }
  }
}

TEST(Shapes, refusals) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), inf = std::numeric_limits<double>::infinity();
  struct Bad {
    ShapeOptions options;
    std::vector<std::string> words;
  };
  const std::vector<Bad> bads{
      {{.shape = "bowll"}, {"no shape 'bowll'", "did you mean 'bowl'"}},
      {{.shape = ""}, {"no shape ''", "hollow-box"}},
      {{.shape = "bar", .dimensions = {{"lengtx", 1.0}}}, {"bar", "'lengtx'", "did you mean 'length'"}},
      {{.shape = "sphere", .dimensions = {{"thickness", 1.0}}}, {"sphere", "'thickness'", "radius"}},
      {{.shape = "bar", .dimensions = {{"length", -1.0}}}, {"bar", "length is -1", "positive"}},
      {{.shape = "bar", .dimensions = {{"width", 0.0}}}, {"width is 0", "positive"}},
      {{.shape = "bar", .dimensions = {{"length", nan}}}, {"length is nan", "positive"}},
      {{.shape = "bar", .dimensions = {{"length", inf}}}, {"length is inf", "positive"}},
      {{.shape = "bar", .dimensions = {{"length", 1e9}}}, {"length is 1e+09", "metres"}},
      {{.shape = "tube", .dimensions = {{"wall", 0.0125}}},
       {"tube", "wall is 0.0125", "less than the outer radius", "thinner wall", "shape cylinder"}},
      {{.shape = "tube", .dimensions = {{"wall", 0.5}}}, {"wall is 0.5", "outer radius (0.0125 m)"}},
      {{.shape = "bowl", .dimensions = {{"wall", 0.09}}}, {"bowl", "wall is 0.09", "outer radius"}},
      {{.shape = "bowl", .dimensions = {{"opening-angle", 5.0}}}, {"opening-angle is 5", "20 to 340"}},
      {{.shape = "bowl", .dimensions = {{"opening-angle", nan}}}, {"opening-angle is nan", "20 to 340"}},
      {{.shape = "sphere", .dimensions = {{"wall", 0.05}}}, {"sphere", "wall is 0.05", "the radius"}},
      {{.shape = "sphere", .dimensions = {{"wall", 0.0}}}, {"sphere", "wall is 0", "positive"}},
      {{.shape = "hollow-box", .dimensions = {{"wall", 0.05}}}, {"hollow-box", "half of the shortest edge", "shape box"}},
      {{.shape = "cylinder", .dimensions = {{"wall", 0.01}}}, {"cylinder", "'wall'", "length, radius"}},
      {{.shape = "disc", .dimensions = {{"thickness", -1.0}}}, {"disc", "thickness is -1", "positive"}},
      {{.shape = "ring", .dimensions = {{"thickness", 0.06}}}, {"ring", "thickness is 0.06", "0.9", "hole"}},
      {{.shape = "cone", .dimensions = {{"top-radius", 1e-5}}}, {"cone", "top-radius is 1e-05", "1000", "point"}},
      {{.shape = "cone", .dimensions = {{"top-radius", 0.0}}}, {"cone", "top-radius is 0", "positive"}},
      {{.shape = "cylinder", .order = 2, .target_nodes = 9}, {"cylinder", "9 nodes are too few", "at least"}},
      {{.shape = "box", .order = 3}, {"box", "order 3", "1 or 2"}},
      {{.shape = "box", .target_nodes = 0}, {"box", "0 nodes", "positive"}},
      {{.shape = "hollow-box", .target_nodes = 5}, {"hollow-box", "5 nodes are too few", "at least"}},
      {{.shape = "sphere", .order = 2, .target_nodes = 9}, {"sphere", "9 nodes are too few", "at least"}},
      {{.shape = "box", .target_nodes = 4'000'000'000}, {"box", "too many", "at most"}},
      {{.shape = "box", .edge_m = 1e-9}, {"box", "edge", "longer edge"}},
      {{.shape = "box", .edge_m = -1.0}, {"box", "edge -1", "positive"}},
      {{.shape = "box", .edge_m = nan}, {"box", "edge nan", "positive"}},
      {{.shape = "box", .target_nodes = 100, .edge_m = 0.1}, {"box", "both", "one of them"}}};
  for (const Bad& bad : bads) {
    carillon::tests::expect_error<InputError>(bad.words, [&] { make_shape(bad.options); });
  }
  EXPECT_THROW(make_box({1, 1, 0}, {1, 1, 1}), InputError);
  EXPECT_THROW(make_box({1, 1, 1}, {1, 0, 1}), InputError);
}

}  // namespace
}  // namespace carillon::shapes::tests
