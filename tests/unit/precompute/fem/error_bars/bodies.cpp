#include "tests/unit/precompute/fem/error_bars/bodies.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <fstream>
#include <map>
#include <numbers>
#include <numeric>
#include <random>
#include <sstream>
#include <stdexcept>

#include "precompute/eigen/solve_modes.hpp"
#include "precompute/fem/assemble.hpp"
#include "precompute/mesh/check.hpp"
#include "precompute/mesh/distributed/distribute.hpp"
#include "precompute/mesh/shapes/shapes.hpp"
#include "runtime/base/sort_order.hpp"
#include "tests/support/paths.hpp"

namespace carillon::tests {
namespace {

using mesh::TetMesh;

double find_cpu_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

/// Perturbs the inner nodes of a lattice, those of faces within the faces. keeps_middle: nodes of the mid-plane in x stay in it.
void shake(TetMesh& mesh, double spacing_m, bool keeps_middle) {
  Vec3 low = mesh.nodes_m[0], high = mesh.nodes_m[0];
  for (const Vec3& x : mesh.nodes_m)
    for (int k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], x[k]);
      high[k] = std::max(high[k], x[k]);
    }
  std::mt19937 random(7);
  std::uniform_real_distribution<double> move(-0.18, 0.18);
  for (Vec3& x : mesh.nodes_m)
    for (int k = 0; k < 3; ++k)
      if (x[k] > low[k] + 1e-9 * spacing_m && x[k] < high[k] - 1e-9 * spacing_m &&
          !(keeps_middle && k == 0 && std::abs(x[0] - (low[0] + high[0]) / 2) < 1e-9 * spacing_m))
        x[k] += move(random) * spacing_m;
}

/// A box [m] cut into cells; perturbed unless a dimension has a single cell. in_two: regions 0 and 1, halves along x.
TetMesh make_lattice(const std::array<double, 3>& edges_m, const std::array<int, 3>& cells, bool shaken, bool in_two) {
  TetMesh mesh = shapes::make_box(edges_m, cells, 1);
  if (shaken) {
    double spacing = 1e300;
    for (int k = 0; k < 3; ++k) spacing = std::min(spacing, edges_m[k] / cells[k]);
    shake(mesh, spacing, in_two);
  }
  if (in_two) {
    const auto [low, high] = std::minmax_element(mesh.nodes_m.begin(), mesh.nodes_m.end());  // by x
    const double middle = ((*low)[0] + (*high)[0]) / 2;
    for (std::size_t e = 0; e < mesh.regions.size(); ++e) {
      double x = 0;
      for (int i = 0; i < 4; ++i) x += mesh.nodes_m[mesh.tets[4 * e + i]][0] / 4;
      mesh.regions[e] = x < middle ? 0 : 1;
    }
  }
  return mesh;
}

/// A solid cylinder along z: rings of 6, 12, ... points, layers of prisms cut into three tetrahedra by the order of their corners.
TetMesh make_cylinder(double radius_m, double length_m, int rings, int layers) {
  std::vector<std::array<double, 2>> points{{0, 0}};
  std::vector<int> start{0, 1};
  for (int r = 1; r <= rings; ++r) {
    for (int j = 0; j < 6 * r; ++j) {
      const double angle = 2 * std::numbers::pi * j / (6 * r);
      points.push_back({radius_m * r / rings * std::cos(angle), radius_m * r / rings * std::sin(angle)});
    }
    start.push_back(static_cast<int>(points.size()));
  }
  const auto id = [&](int r, int j) { return r == 0 ? 0 : start[r] + (j + 6 * r) % (6 * r); };
  std::vector<std::array<int, 3>> triangles;
  for (int r = 1; r <= rings; ++r)
    for (int sector = 0; sector < 6; ++sector)
      for (int i = 0; i < r; ++i) {
        triangles.push_back({id(r - 1, sector * (r - 1) + i), id(r, sector * r + i), id(r, sector * r + i + 1)});
        if (i < r - 1)
          triangles.push_back({id(r - 1, sector * (r - 1) + i), id(r, sector * r + i + 1), id(r - 1, sector * (r - 1) + i + 1)});
      }
  TetMesh mesh;
  const int count = static_cast<int>(points.size());
  for (int l = 0; l <= layers; ++l)
    for (const auto& p : points) mesh.nodes_m.push_back({p[0], p[1], length_m * (static_cast<double>(l) / layers - 0.5)});
  for (int l = 0; l < layers; ++l)
    for (std::array<int, 3> t : triangles) {
      std::sort(t.begin(), t.end());
      const int low = l * count, high = low + count;
      for (int k = 0; k < 3; ++k) {
        std::array<std::int32_t, 4> tet{};
        for (int i = 0; i <= k; ++i) tet[i] = low + t[i];
        for (int i = k; i < 3; ++i) tet[i + 1] = high + t[i];
        mesh.tets.insert(mesh.tets.end(), tet.begin(), tet.end());
        mesh.regions.push_back(0);
      }
    }
  return mesh;
}

/// Moves mid nodes of edges on a cylinder's lateral surface onto it.
void curve_cylinder(TetMesh& mesh, double radius_m) {
  for (std::size_t e = 0; e < mesh.tets.size(); e += 10)
    for (int m = 0; m < 6; ++m) {
      const Vec3 &a = mesh.nodes_m[mesh.tets[e + mesh::kEdges[m][0]]], &b = mesh.nodes_m[mesh.tets[e + mesh::kEdges[m][1]]];
      if (std::abs(std::hypot(a[0], a[1]) - radius_m) > 1e-9 * radius_m || std::abs(std::hypot(b[0], b[1]) - radius_m) > 1e-9 * radius_m)
        continue;
      Vec3& x = mesh.nodes_m[mesh.tets[e + 4 + m]];
      const double scale = radius_m / std::hypot((a[0] + b[0]) / 2, (a[1] + b[1]) / 2);
      x = {(a[0] + b[0]) / 2 * scale, (a[1] + b[1]) / 2 * scale, (a[2] + b[2]) / 2};
    }
}

bool is_quadratic(MeshKind kind) { return kind == MeshKind::T10 || kind == MeshKind::T10Curved || kind == MeshKind::T10Lumped; }

TetMesh finish(TetMesh mesh, MeshKind kind) {
  mesh::check_mesh(mesh);
  if (!is_quadratic(kind)) return mesh::to_linear(mesh);
  return kind == MeshKind::T10Curved && mesh.order == 2 ? mesh : mesh::to_quadratic(mesh::to_linear(mesh));
}

/// Nodes of the face of lowest x if the body is fixed there.
std::vector<std::int32_t> find_fixed(const Body& body, const TetMesh& mesh) {
  std::vector<std::int32_t> fixed;
  if (!body.fixed) return fixed;
  double low = 1e300;
  for (const Vec3& x : mesh.nodes_m) low = std::min(low, x[0]);
  for (std::size_t i = 0; i < mesh.nodes_m.size(); ++i)
    if (mesh.nodes_m[i][0] < low + 1e-9) fixed.push_back(static_cast<std::int32_t>(i));
  return fixed;
}

TetMesh make_shape_mesh(const std::string& shape, const std::map<std::string, double>& dimensions, int nodes, MeshKind kind) {
  return finish(
      shapes::make_shape({.shape = shape, .dimensions = dimensions, .order = kind == MeshKind::T10Curved ? 2 : 1, .target_nodes = nodes}),
      kind);
}

/// A tube along x, its outer radius widened from 0.02 to 0.05 m.
TetMesh make_cone(int nodes, MeshKind kind) {
  TetMesh mesh = make_shape_mesh("tube", {{"length", 0.06}, {"outer-radius", 0.035}, {"wall", 0.003}}, nodes, kind);
  for (Vec3& x : mesh.nodes_m) {
    const double radius = std::hypot(x[1], x[2]), scale = (radius + 0.5 * x[0]) / radius;
    x = {x[0], scale * x[1], scale * x[2]};
  }
  return mesh;
}

}  // namespace

std::vector<Truth> read_truth(const std::string& body) {
  std::ifstream file(carillon::tests::get_source_dir() + "/tests/unit/precompute/fem/error_bars/data/known_frequencies.csv");
  std::vector<Truth> truth;
  for (std::string line; std::getline(file, line);) {
    if (!line.starts_with(body + ",")) continue;
    std::istringstream rest(line.substr(body.size() + 1));
    Truth row;
    char comma = 0;
    rest >> row.freq_hz >> comma >> row.uncertainty;
    truth.push_back(row);
  }
  if (truth.empty()) throw std::runtime_error("no known frequencies of " + body);
  return truth;
}

std::string describe(MeshKind kind) {
  switch (kind) {
    case MeshKind::T4:
      return "T4";
    case MeshKind::T4Lumped:
      return "T4 lumped";
    case MeshKind::T10:
      return "T10";
    case MeshKind::T10Curved:
      return "T10 curved";
    case MeshKind::T10Lumped:
      return "T10 lumped";
  }
  return "";
}

std::string describe(Role role) { return role == Role::training ? "training" : role == Role::test ? "test" : "unseen"; }

const std::vector<Body>& get_bodies() {
  // Spruce along x; 2, 3: radial and tangential directions.
  static const material::Material spruce{.density_kg_m3 = 400,
                                         .orthotropic = material::Orthotropic{.young_modulus_pa = {10.8e9, 0.84e9, 0.46e9},
                                                                              .shear_modulus_pa = {0.69e9, 0.032e9, 0.66e9},
                                                                              .poisson_ratio = {0.372, 0.435, 0.467}}};
  static const material::Material maple{
      .density_kg_m3 = 590,
      .orthotropic = material::Orthotropic{
          .young_modulus_pa = {12.6e9, 1.7e9, 0.8e9}, .shear_modulus_pa = {1.6e9, 0.4e9, 1.4e9}, .poisson_ratio = {0.35, 0.5, 0.38}}};
  static const material::Material rosewood{
      .density_kg_m3 = 870,
      .orthotropic = material::Orthotropic{
          .young_modulus_pa = {18e9, 2.2e9, 1.2e9}, .shear_modulus_pa = {1.8e9, 0.5e9, 1.5e9}, .poisson_ratio = {0.36, 0.55, 0.4}}};
  static const material::Material cedar{
      .density_kg_m3 = 350,
      .orthotropic = material::Orthotropic{
          .young_modulus_pa = {8e9, 0.62e9, 0.4e9}, .shear_modulus_pa = {0.6e9, 0.05e9, 0.55e9}, .poisson_ratio = {0.38, 0.45, 0.45}}};
  const auto solid = [](double young_modulus_pa, double poisson_ratio, double density_kg_m3) {
    return std::vector<material::Material>{
        {.young_modulus_pa = young_modulus_pa, .poisson_ratio = poisson_ratio, .density_kg_m3 = density_kg_m3}};
  };
  const auto pair = [&](double nu_steel, double nu_aluminium) {
    return std::vector<material::Material>{solid(200e9, nu_steel, 7850)[0], solid(70e9, nu_aluminium, 2700)[0]};
  };
  // Fineness: cells along the shortest edge of a box (negative: unperturbed), ten times the cells across a strip plus its layers, rings of
  // a cylinder, or the nodes of a shape.
  static const std::vector<Body> bodies{
      {"cube", solid(200e9, 0.3, 7850), false, Role::training, {3, 6, 10}},
      {"bar", solid(70e9, 0.33, 2700), false, Role::training, {-1, 2, 4}},
      {"plate", solid(200e9, 0.3, 7850), false, Role::training, {-1, 2, 3}},
      {"cantilever", solid(70e9, 0.33, 2700), false, Role::training, {-1, 2, 4}, false, true},
      {"ball", solid(200e9, 0.3, 7850), true, Role::training, {300, 1200, 6000}},
      {"thin-shell", solid(200e9, 0.3, 7850), true, Role::training, {800, 3000, 9000}},
      {"ring", solid(100e9, 0.34, 8500), true, Role::training, {300, 1200, 6000}},
      {"cube-nu045", solid(200e9, 0.45, 7850), false, Role::test, {3, 6}},
      {"box", solid(200e9, 0.3, 7850), false, Role::test, {-3, 5, 8}},
      {"slab", solid(200e9, 0.3, 7850), false, Role::test, {-1, 2, 3}},
      {"prism", solid(200e9, 0.3, 7850), false, Role::test, {2, 5}},
      {"ruler", solid(200e9, 0.3, 7850), false, Role::test, {-1, -2}},
      {"thick-shell", solid(200e9, 0.3, 8000), true, Role::test, {600, 2500, 8000}},
      {"pipe", solid(200e9, 0.3, 8000), true, Role::test, {500, 2500, 8000}},
      {"cylinder-2", solid(200e9, 0.3, 7850), true, Role::test, {2, 4, 7}},
      {"cylinder-10", solid(200e9, 0.3, 7850), true, Role::test, {2, 4}},
      {"disc", solid(200e9, 0.3, 7850), true, Role::test, {3, 5, 8}},
      {"slender-bar", solid(200e9, 0.3, 7850), false, Role::test, {1000, 5000}},
      {"chime", solid(68.3518e9, 0.329801, 2700), true, Role::test, {1000, 5000}},
      {"spruce-bar", {spruce}, false, Role::test, {1, 2, 3}},
      {"spruce-block", {spruce}, false, Role::test, {3, 6}},
      {"rod-two", pair(0, 0), false, Role::test, {1, 2, 4}},
      {"bar-two", pair(0.3, 0.33), false, Role::test, {1, 2, 4}},
      {"rubber-ball", solid(10e6, 0.4999, 1100), true, Role::test, {300, 1200}, true},
      {"strip-thin", solid(200e9, 0.3, 7850), false, Role::test, {41, 62, 63}},
      {"strip-thick", solid(200e9, 0.3, 7850), false, Role::test, {41, 62, 63}},
      {"strip-nu0", solid(200e9, 0, 7850), false, Role::test, {41, 62, 63}},
      {"strip-nu045", solid(200e9, 0.45, 7850), false, Role::test, {41, 62, 63}},
      {"strip-spruce", {spruce}, false, Role::test, {41, 62, 63}},
      {"strip-fixed", solid(200e9, 0.3, 7850), false, Role::test, {41, 62, 63}, false, true},
      {"plate-thin", solid(200e9, 0.3, 7850), false, Role::test, {61, 122, 123}},
      {"shell-3", solid(200e9, 0.3, 7850), true, Role::test, {300, 1200, 4000}},
      {"shell-5", solid(200e9, 0.3, 7850), true, Role::test, {300, 1200, 4000}},
      {"shell-7", solid(200e9, 0.3, 7850), true, Role::test, {400, 1600, 4000}},
      {"slat", solid(210e9, 0.25, 7800), false, Role::unseen, {-1, 2, 3}},
      {"tile", solid(65e9, 0.22, 2500), false, Role::unseen, {-1, 2, 3}},
      {"brick", solid(370e9, 0.18, 3900), false, Role::unseen, {3, 5, 8}},
      {"stick", solid(3.2e9, 0.38, 1180), false, Role::unseen, {-1, 2, 4}},
      {"maple-plate", {maple}, false, Role::unseen, {-1, 2}},
      {"rosewood-bar", {rosewood}, false, Role::unseen, {-1, 2, 3}},
      {"shelf", solid(200e9, 0.29, 7800), false, Role::unseen, {-1, 2}, false, true},
      {"post", solid(70e9, 0.33, 2700), false, Role::unseen, {2, 3, 5}, false, true},
      {"reed", solid(105e9, 0.35, 8500), false, Role::unseen, {41, 62}},
      {"coaster", solid(64e9, 0.2, 2230), false, Role::unseen, {-1, 2, 3}},
      {"shell-85", solid(70e9, 0.2, 2500), true, Role::test, {600, 2400, 6000}},
      {"shell-95", solid(200e9, 0.28, 7850), true, Role::test, {1200, 4000, 9000}},
      {"shell-20", solid(16e9, 0.44, 11000), true, Role::test, {400, 1600, 4000}},
      {"collar", solid(110e9, 0.35, 8900), true, Role::unseen, {600, 2400}},
      {"washer", solid(200e9, 0.29, 7850), true, Role::unseen, {800, 2500}},
      {"cone", solid(70e9, 0.33, 2700), true, Role::unseen, {800, 2500}},
      {"shell-60", solid(3e9, 0.4, 1200), true, Role::unseen, {500, 2000}},
      {"shell-92", solid(70e9, 0.22, 2500), true, Role::unseen, {1000, 3500}},
      {"board", {cedar}, false, Role::unseen, {-1, 2}},
  };
  return bodies;
}

const Body& get_body(const std::string& name) {
  for (const Body& body : get_bodies())
    if (body.name == name) return body;
  throw std::runtime_error("no body " + name);
}

TetMesh make_mesh(const Body& body, int fineness, MeshKind kind, std::vector<std::int32_t>& fixed) {
  const int n = std::abs(fineness);
  const bool shaken = fineness > 0;
  fixed.clear();
  const std::map<std::string, std::pair<Vec3, std::array<int, 3>>> boxes{
      {"cube", {{0.05, 0.05, 0.05}, {n, n, n}}},
      {"cube-nu045", {{0.05, 0.05, 0.05}, {n, n, n}}},
      {"box", {{0.05, 0.065, 0.085}, {n, static_cast<int>(1.3 * n), static_cast<int>(1.7 * n)}}},
      {"slab", {{0.1, 0.1, 0.01}, {8 * n, 8 * n, n}}},
      {"prism", {{0.05, 0.05, 0.1}, {n, n, 2 * n}}},
      {"bar", {{0.3, 0.03, 0.012}, {n == 1 ? 30 : 16 * n, 2 * n, n}}},
      {"cantilever", {{0.3, 0.03, 0.012}, {n == 1 ? 30 : 16 * n, 2 * n, n}}},
      {"ruler", {{0.3, 0.025, 0.001}, {80 * n, 6 * n, n}}},
      {"plate", {{0.2, 0.2, 0.005}, {16 * n, 16 * n, n}}},
      {"spruce-bar", {{0.3, 0.04, 0.015}, {16 * n, 3 * n, n}}},
      {"slat", {{0.25, 0.03, 0.004}, {25 * n, 4 * n, n}}},
      {"tile", {{0.15, 0.1, 0.006}, {15 * n, 10 * n, n}}},
      {"brick", {{0.08, 0.05, 0.03}, {8 * n / 3, 5 * n / 3, n}}},
      {"stick", {{0.2, 0.012, 0.012}, {16 * n, n, n}}},
      {"maple-plate", {{0.2, 0.12, 0.004}, {20 * n, 12 * n, n}}},
      {"rosewood-bar", {{0.2, 0.04, 0.015}, {14 * n, 3 * n, n}}},
      {"shelf", {{0.12, 0.08, 0.003}, {18 * n, 12 * n, n}}},
      {"post", {{0.1, 0.02, 0.015}, {6 * n, 4 * n / 3, n}}},
      {"board", {{0.25, 0.18, 0.0035}, {20 * n, 14 * n, n}}},
      {"coaster", {{0.06, 0.06, 0.008}, {8 * n, 8 * n, n}}},
      {"spruce-block", {{0.05, 0.065, 0.085}, {n, static_cast<int>(1.3 * n), static_cast<int>(1.7 * n)}}},
      {"rod-two", {{0.3, 0.03, 0.02}, {14 * n, 2 * n, n}}},
      {"bar-two", {{0.3, 0.03, 0.02}, {14 * n, 2 * n, n}}}};
  if (const auto found = boxes.find(body.name); found != boxes.end()) {
    TetMesh mesh = finish(make_lattice(found->second.first, found->second.second, shaken, body.materials.size() == 2), kind);
    fixed = find_fixed(body, mesh);
    return mesh;
  }
  const std::map<std::string, std::pair<Vec3, int>> strips{
      {"strip-thin", {{0.3, 0.03, 0.001}, 10}},  {"strip-thick", {{0.3, 0.03, 0.003}, 10}}, {"strip-nu0", {{0.2, 0.025, 0.002}, 8}},
      {"strip-nu045", {{0.1, 0.01, 0.001}, 10}}, {"strip-spruce", {{0.3, 0.04, 0.003}, 8}}, {"strip-fixed", {{0.2, 0.02, 0.001}, 10}},
      {"reed", {{0.18, 0.025, 0.0012}, 7}},      {"plate-thin", {{0.1, 0.09, 0.002}, 1}}};
  if (const auto found = strips.find(body.name); found != strips.end()) {
    const int across = n / 10, layers = n % 10;
    TetMesh mesh = finish(make_lattice(found->second.first, {found->second.second * across, across, layers}, layers > 1, false), kind);
    fixed = find_fixed(body, mesh);
    return mesh;
  }
  for (const int tenths : {3, 5, 7})
    if (body.name == "shell-" + std::to_string(tenths))
      return make_shape_mesh("sphere", {{"radius", 0.1}, {"wall", 0.1 - 0.01 * tenths}}, n, kind);
  if (body.name == "shell-20") return make_shape_mesh("sphere", {{"radius", 0.02}, {"wall", 0.016}}, n, kind);
  if (body.name == "shell-85") return make_shape_mesh("sphere", {{"radius", 0.1}, {"wall", 0.015}}, n, kind);
  if (body.name == "shell-95") return make_shape_mesh("sphere", {{"radius", 0.04}, {"wall", 0.002}}, n, kind);
  if (body.name == "shell-60") return make_shape_mesh("sphere", {{"radius", 0.05}, {"wall", 0.02}}, n, kind);
  if (body.name == "shell-92") return make_shape_mesh("sphere", {{"radius", 0.06}, {"wall", 0.0048}}, n, kind);
  if (body.name == "collar") return make_shape_mesh("tube", {{"length", 0.04}, {"outer-radius", 0.03}, {"wall", 0.0025}}, n, kind);
  if (body.name == "washer") return make_shape_mesh("tube", {{"length", 0.004}, {"outer-radius", 0.06}, {"wall", 0.045}}, n, kind);
  if (body.name == "cone") return make_cone(n, kind);
  if (body.name == "slender-bar") return make_shape_mesh("bar", {{"length", 0.3}, {"width", 0.02}, {"thickness", 0.01}}, n, kind);
  if (body.name == "ball" || body.name == "rubber-ball") return make_shape_mesh("sphere", {{"radius", 0.05}}, n, kind);
  if (body.name == "thick-shell") return make_shape_mesh("sphere", {{"radius", 6.0}, {"wall", 4.2}}, n, kind);
  if (body.name == "thin-shell") return make_shape_mesh("sphere", {{"radius", 0.05}, {"wall", 0.005}}, n, kind);
  if (body.name == "ring") return make_shape_mesh("tube", {{"length", 0.012}, {"outer-radius", 0.04}, {"wall", 0.01}}, n, kind);
  if (body.name == "pipe") return make_shape_mesh("tube", {{"length", 10.0}, {"outer-radius", 2.2}, {"wall", 0.4}}, n, kind);
  if (body.name == "chime") return make_shape_mesh("tube", {{"length", 0.505}, {"outer-radius", 0.0125}, {"wall", 0.001}}, n, kind);
  const std::map<std::string, double> lengths_m{{"disc", 0.02}, {"cylinder-2", 0.04}, {"cylinder-10", 0.2}};
  const double length = lengths_m.at(body.name);
  TetMesh mesh = finish(make_cylinder(0.02, length, n, std::max(1, static_cast<int>(std::lround(n * length / 0.02)))), kind);
  if (kind == MeshKind::T10Curved) curve_cylinder(mesh, 0.02);
  return mesh;
}

double Outcome::error_cents(std::size_t m) const { return 1200 * std::log2(freq_hz[m] / true_hz[m]); }

double Outcome::corrected_error_cents(std::size_t m) const {
  return 600 * std::log2(bars.corrected.lambda[by_correction[m]]) - 1200 * std::log2(2 * std::numbers::pi * true_hz[m]);
}

double Outcome::corrected_bar_cents(std::size_t m) const {
  return bars.algebraic_cents[by_correction[m]] + bars.corrected.cents[by_correction[m]];
}

namespace {

double find_median(std::vector<double> values) {
  if (values.empty()) return 0.0;
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

}  // namespace

double Outcome::median_error_cents() const {
  std::vector<double> errors;
  for (std::size_t m = 0; m < true_hz.size(); ++m) errors.push_back(std::abs(error_cents(m)));
  return find_median(std::move(errors));
}

double Outcome::median_corrected_error_cents() const {
  std::vector<double> errors;
  for (std::size_t m = 0; m < true_hz.size(); ++m) errors.push_back(std::abs(corrected_error_cents(m)));
  return find_median(std::move(errors));
}

double Outcome::coverage() const {
  int good = 0;
  for (std::size_t m = 0; m < true_hz.size(); ++m) good += contains(m) ? 1 : 0;
  return true_hz.empty() ? 1.0 : static_cast<double>(good) / static_cast<double>(true_hz.size());
}

double Outcome::median_width() const {
  std::vector<double> widths;
  for (std::size_t m = 0; m < true_hz.size(); ++m)
    if (std::abs(error_cents(m)) > 3 * truth_cents[m]) widths.push_back(bar_cents(m) / std::abs(error_cents(m)));
  return widths.empty() ? 1.0 : find_median(std::move(widths));
}

Outcome solve(MPI_Comm comm, const TetMesh& mesh, const std::vector<std::int32_t>& fixed, std::span<const material::Material> materials,
              bool lumped, double low_hz, double high_hz, int max_modes, double tolerance) {
  const job::Mass mass = lumped ? job::Mass::lumped : job::Mass::consistent;
  const mesh::DistributedMesh pieces = mesh::distribute(comm, mesh, fixed);
  fem::Materials solid;
  solid.list.assign(materials.begin(), materials.end());
  if (materials.size() > 1) solid.of_tet = pieces.local.region;
  std::vector<error_bars::Solid> solids;
  for (const material::Material& material : materials) solids.push_back({material.calc_elasticity_pa(), material.density_kg_m3});
  const fem::System system = fem::assemble(comm, pieces.local, solid, mass);
  eigen::NodeLayout layout;
  layout.nodes_m.assign(pieces.local.nodes_m.begin(), pieces.local.nodes_m.begin() + pieces.local.free_nodes);
  layout.component.assign(pieces.local.component.begin(), pieces.local.component.begin() + pieces.local.free_nodes);
  layout.component_count = pieces.components;
  layout.fixed = pieces.fixed_m;
  eigen::Options options;
  options.low_hz = low_hz;
  options.high_hz = high_hz;
  if (max_modes > 0) options.max_modes = max_modes;
  options.tolerance = tolerance;
  const double start = find_cpu_s();
  const eigen::Modes modes = eigen::solve_modes({system.stiffness, system.mass, layout}, options);
  Outcome outcome;
  outcome.solve_cpu_s = find_cpu_s() - start;
  outcome.unknowns = 3 * pieces.free_nodes;
  for (const double l : modes.lambda) outcome.freq_hz.push_back(std::sqrt(l) / (2 * std::numbers::pi));
  const bool cut = modes.band_count > static_cast<std::int64_t>(modes.lambda.size());
  const double begin = find_cpu_s();
  outcome.bars = error_bars::calc_error_bars(comm, pieces.local, system.stiffness, system.mass, solids, solid.of_tet, mass,
                                             {modes.lambda, modes.residual, modes.shapes, low_hz, cut ? outcome.freq_hz.back() : high_hz,
                                              modes.count_below_low - modes.rigid_count - modes.mechanism_count});
  outcome.estimate_cpu_s = find_cpu_s() - begin;
  outcome.by_correction = base::find_sort_order(outcome.bars.corrected.lambda);
  return outcome;
}

Outcome solve(MPI_Comm comm, const Body& body, const TetMesh& given, MeshKind kind, double tolerance) {
  const std::vector<Truth> truth = read_truth(body.name);
  const TetMesh mesh = finish(given, kind);
  Outcome outcome = solve(comm, mesh, find_fixed(body, mesh), body.materials, kind == MeshKind::T4Lumped || kind == MeshKind::T10Lumped,
                          0.2 * truth.front().freq_hz, 30 * truth.back().freq_hz,
                          static_cast<int>(error_bars::find_computed_count(truth.size())), tolerance);
  for (std::size_t m = 0; m < std::min(truth.size(), outcome.freq_hz.size()); ++m) {
    outcome.true_hz.push_back(truth[m].freq_hz);
    outcome.truth_cents.push_back(1200 * std::log2(1 + truth[m].uncertainty));
  }
  return outcome;
}

Outcome solve(MPI_Comm comm, const Body& body, int fineness, MeshKind kind, double tolerance) {
  std::vector<std::int32_t> fixed;
  return solve(comm, body, make_mesh(body, fineness, kind, fixed), kind, tolerance);
}

}  // namespace carillon::tests
