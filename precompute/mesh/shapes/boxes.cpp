// Bodies on Cartesian lattices: bar, plate, box, hollow box, and tube (lattice in x, radius and angle).
//
// Method: integer numbers of cells; the hollow box omits the cells of its cavity. Tube radii grow geometrically, so that cells of a thick
//   wall keep their aspect ratio. Mid-side nodes of the tube lie at the mean radius and angle of their corners: exact on the cylinders,
//   blended across the wall, so that no element folds.
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "precompute/mesh/shapes/lattice.hpp"
#include "precompute/mesh/shapes/plan.hpp"
#include "precompute/mesh/shapes/shapes.hpp"

namespace carillon::shapes {
namespace {

using Cells = std::array<int, 3>;

// Names the nodes at both ends of a lattice axis.
void add_end_sets(mesh::TetMesh& mesh, const std::vector<Cells>& indices, int axis, int cells, const std::string& low_name,
                  const std::string& high_name) {
  auto& low = mesh.node_sets[low_name];
  auto& high = mesh.node_sets[high_name];
  for (std::size_t n = 0; n < indices.size(); ++n) {
    if (indices[n][axis] == 0) low.push_back(static_cast<std::int32_t>(n));
    if (indices[n][axis] == cells) high.push_back(static_cast<std::int32_t>(n));
  }
}

void add_face_sets(mesh::TetMesh& mesh, const std::vector<Cells>& indices, const Cells& cells) {
  add_end_sets(mesh, indices, 0, cells[0], "x-min", "x-max");
  add_end_sets(mesh, indices, 1, cells[1], "y-min", "y-max");
  add_end_sets(mesh, indices, 2, cells[2], "z-min", "z-max");
}

void raise_straight(mesh::TetMesh& mesh) {
  raise_order(mesh, [&mesh](std::int32_t a, std::int32_t b) { return calc_middle(mesh.nodes_m[a], mesh.nodes_m[b]); });
}

long long multiply(const Cells& n) { return static_cast<long long>(n[0]) * n[1] * n[2]; }
long long calc_face_cells(const Cells& n) { return 1LL * n[0] * n[1] + 1LL * n[1] * n[2] + 1LL * n[2] * n[0]; }

// Box with a cavity of `cavity` cells behind walls of `layers` cells.
mesh::TetMesh make_hollow_box(const std::array<double, 3>& edges, double wall, const Cells& cavity, int layers, int order) {
  Lattice lattice;
  for (int axis = 0; axis < 3; ++axis) lattice.cells[axis] = cavity[axis] + 2 * layers;
  lattice.keep = [&](int i, int j, int k) {
    const auto inside = [&](int at, int axis) { return at >= layers && at < layers + cavity[axis]; };
    return !(inside(i, 0) && inside(j, 1) && inside(k, 2));
  };
  const auto place = [&](int at, int axis) {
    const int cells = lattice.cells[axis];
    const double half = 0.5 * edges[axis];
    if (at == 0) return -half;
    if (at == cells) return half;
    if (at <= layers) return -half + wall * at / layers;
    if (at >= cells - layers) return half - wall * (cells - at) / layers;
    return (2.0 * (at - layers) / cavity[axis] - 1.0) * (half - wall);
  };
  std::vector<Cells> indices;
  mesh::TetMesh mesh = make_lattice(
      lattice,
      [&](int i, int j, int k) {
        return Vec3{place(i, 0), place(j, 1), place(k, 2)};
      },
      &indices);
  add_face_sets(mesh, indices, lattice.cells);
  if (order == 2) raise_straight(mesh);
  return mesh;
}

mesh::TetMesh make_tube(double length, double outer_radius, double wall, int along, int layers, int around, int order) {
  const double inner_radius = outer_radius - wall;
  Lattice lattice;
  lattice.cells = {along, layers, around};
  lattice.periodic_axis = 2;
  const auto radius = [&](int layer) {
    if (layer == layers) return outer_radius;
    return inner_radius * std::pow(outer_radius / inner_radius, static_cast<double>(layer) / layers);
  };
  std::vector<Cells> indices;
  mesh::TetMesh mesh = make_lattice(
      lattice,
      [&](int i, int j, int k) {
        const double angle = 2.0 * std::numbers::pi * k / around;
        return Vec3{length * (static_cast<double>(i) / along - 0.5), radius(j) * std::cos(angle), radius(j) * std::sin(angle)};
      },
      &indices);
  add_end_sets(mesh, indices, 0, along, "end-min", "end-max");
  add_end_sets(mesh, indices, 1, layers, "inner", "outer");
  if (order == 2) {
    raise_order(mesh, [&](std::int32_t a, std::int32_t b) {
      Vec3 middle = calc_middle(mesh.nodes_m[a], mesh.nodes_m[b]);
      const double stretch = 0.5 * (radius(indices[a][1]) + radius(indices[b][1])) / std::hypot(middle[1], middle[2]);
      middle[1] *= stretch;
      middle[2] *= stretch;
      return middle;
    });
  }
  return mesh;
}

}  // namespace

mesh::TetMesh make_box(const std::array<double, 3>& edges_m, const std::array<int, 3>& divisions, int order) {
  for (int axis = 0; axis < 3; ++axis) {
    if (!(edges_m[axis] > 0.0) || !std::isfinite(edges_m[axis])) {
      throw InputError(fmt::format("box: edge {} is {} m; give a positive length", axis, edges_m[axis]));
    }
    if (divisions[axis] < 1) throw InputError(fmt::format("box: {} divisions along axis {}; give at least 1", divisions[axis], axis));
  }
  if (order != 1 && order != 2) throw InputError(fmt::format("box: order {}; give 1 or 2", order));
  Lattice lattice;
  lattice.cells = divisions;
  std::vector<Cells> indices;
  mesh::TetMesh mesh = make_lattice(
      lattice,
      [&](int i, int j, int k) {
        return Vec3{edges_m[0] * (static_cast<double>(i) / divisions[0] - 0.5), edges_m[1] * (static_cast<double>(j) / divisions[1] - 0.5),
                    edges_m[2] * (static_cast<double>(k) / divisions[2] - 0.5)};
      },
      &indices);
  add_face_sets(mesh, indices, divisions);
  if (order == 2) raise_straight(mesh);
  return mesh;
}

Body plan_box(const std::array<double, 3>& edges_m, int order) {
  Body body;
  body.lengths = {edges_m[0], edges_m[1], edges_m[2], 0.0};
  if (order == 1) body.wanted = {2, 2, 2, 1};
  body.calc_counts = [](const Divisions& d) {
    const Cells n{d[0], d[1], d[2]};
    return Counts{multiply({n[0] + 1, n[1] + 1, n[2] + 1}), 6 * multiply(n), 4 * calc_face_cells(n), 1};
  };
  body.make = [edges_m, order](const Divisions& d) { return make_box(edges_m, {d[0], d[1], d[2]}, order); };
  return body;
}

Body plan_hollow_box(const std::array<double, 3>& edges_m, double wall_m, int order) {
  Body body;
  for (int axis = 0; axis < 3; ++axis) body.lengths[axis] = edges_m[axis] - 2.0 * wall_m;
  body.lengths[3] = wall_m;
  body.wanted = {2, 2, 2, order == 1 ? 2 : 1};
  body.calc_counts = [](const Divisions& d) {
    const Cells c{d[0], d[1], d[2]};
    const Cells n{c[0] + 2 * d[3], c[1] + 2 * d[3], c[2] + 2 * d[3]};
    return Counts{multiply({n[0] + 1, n[1] + 1, n[2] + 1}) - multiply({c[0] - 1, c[1] - 1, c[2] - 1}), 6 * (multiply(n) - multiply(c)),
                  4 * (calc_face_cells(n) + calc_face_cells(c)), 2};
  };
  body.make = [edges_m, wall_m, order](const Divisions& d) { return make_hollow_box(edges_m, wall_m, {d[0], d[1], d[2]}, d[3], order); };
  return body;
}

Body plan_tube(double length_m, double outer_radius_m, double wall_m, int order) {
  const double inner_radius = outer_radius_m - wall_m;
  const double mean_radius = outer_radius_m - 0.5 * wall_m;
  Body body;
  // An even number of cells around, so that the mirrored lattice closes.
  body.lengths = {length_m, mean_radius * std::log(outer_radius_m / inner_radius), std::numbers::pi * mean_radius, 0.0};
  body.coarsest = {1, 1, 4, 1};
  body.wanted = {2, order == 1 ? 2 : 1, 6, 1};
  body.calc_counts = [](const Divisions& d) {
    const long long along = d[0], layers = d[1], around = 2LL * d[2];
    return Counts{(along + 1) * (layers + 1) * around, 6 * along * layers * around, 4 * around * (along + layers), 0};
  };
  body.make = [=](const Divisions& d) { return make_tube(length_m, outer_radius_m, wall_m, d[0], d[1], 2 * d[2], order); };
  return body;
}

}  // namespace carillon::shapes
