// The bodies with flat faces: bar, plate, box, hollow box.
#include <fmt/core.h>

#include <cmath>
#include <string>

#include "precompute/shapes/lattice.hpp"
#include "precompute/shapes/shapes.hpp"

namespace carillon::shapes {
namespace {

// Names the nodes on the six planes of the bounding lattice.
void add_face_sets(mesh::TetMesh& mesh, const std::vector<std::array<int, 3>>& indices, const std::array<int, 3>& cells) {
  constexpr std::array<const char*, 3> kAxis{"x", "y", "z"};
  for (int axis = 0; axis < 3; ++axis) {
    auto& low = mesh.node_sets[std::string(kAxis[axis]) + "-min"];
    auto& high = mesh.node_sets[std::string(kAxis[axis]) + "-max"];
    for (std::size_t n = 0; n < indices.size(); ++n) {
      if (indices[n][axis] == 0) low.push_back(static_cast<std::int32_t>(n));
      if (indices[n][axis] == cells[axis]) high.push_back(static_cast<std::int32_t>(n));
    }
  }
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
  std::vector<std::array<int, 3>> indices;
  mesh::TetMesh mesh = make_lattice(
      lattice,
      [&](int i, int j, int k) {
        return Vec3{edges_m[0] * (static_cast<double>(i) / divisions[0] - 0.5), edges_m[1] * (static_cast<double>(j) / divisions[1] - 0.5),
                    edges_m[2] * (static_cast<double>(k) / divisions[2] - 0.5)};
      },
      &indices);
  add_face_sets(mesh, indices, divisions);
  if (order == 2) raise_order(mesh, [&](std::int32_t a, std::int32_t b) { return calc_middle(mesh.nodes[a], mesh.nodes[b]); });
  return mesh;
}

}  // namespace carillon::shapes
