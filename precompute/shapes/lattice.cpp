// Method: A cell of a lattice is cut into the six tetrahedra of Kuhn, the monotone paths from one corner to the opposite one, and the cut
// is
//   mirrored from cell to cell by the parity of its index (the J1 triangulation). Neighbours then share the diagonals of their faces, and
//   an evenly divided box keeps its three mirror planes, so bending modes of a square bar stay degenerate. A prism is cut along the
//   diagonals that start at the smallest index, which conforms by construction.
// Source: Kuhn 1960, IBM J. Res. Dev. 4; Todd 1976, "The Computation of Fixed Points and Applications" (J1); Dompierre et al. 1999,
//   "How to subdivide pyramids, prisms and hexahedra into tetrahedra".
// Deviations: none.
#include "precompute/shapes/lattice.hpp"

#include <algorithm>
#include <unordered_map>
#include <utility>

namespace carillon::shapes {
namespace {

// The six orders in which a monotone path takes the three axes, and whether the order is an odd permutation.
constexpr std::array<std::array<int, 4>, 6> kPaths{{{0, 1, 2, 0}, {1, 2, 0, 0}, {2, 0, 1, 0}, {0, 2, 1, 1}, {2, 1, 0, 1}, {1, 0, 2, 1}}};

}  // namespace

Vec3 calc_middle(const Vec3& a, const Vec3& b) { return {0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])}; }

mesh::TetMesh make_lattice(const Lattice& lattice, const std::function<Vec3(int, int, int)>& place,
                           std::vector<std::array<int, 3>>* indices) {
  std::array<int, 3> points{};
  for (int axis = 0; axis < 3; ++axis) points[axis] = lattice.cells[axis] + (axis == lattice.periodic_axis ? 0 : 1);
  std::vector<std::int32_t> node_of(static_cast<std::size_t>(points[0]) * points[1] * points[2], -1);
  const auto slot = [&](const std::array<int, 3>& p) {
    return (static_cast<std::size_t>(p[2] % points[2]) * points[1] + p[1] % points[1]) * points[0] + p[0] % points[0];
  };

  mesh::TetMesh mesh;
  std::vector<std::size_t> corners;  // slots, four a tetrahedron
  for (int k = 0; k < lattice.cells[2]; ++k) {
    for (int j = 0; j < lattice.cells[1]; ++j) {
      for (int i = 0; i < lattice.cells[0]; ++i) {
        if (lattice.keep && !lattice.keep(i, j, k)) continue;
        const std::array<int, 3> cell{i, j, k};
        const bool mirrored = ((i + j + k) & 1) != 0;  // an odd number of mirrored axes turns the orientation
        for (const auto& path : kPaths) {
          std::array<int, 3> at{};
          for (int axis = 0; axis < 3; ++axis) at[axis] = cell[axis] + (cell[axis] & 1);
          std::array<std::size_t, 4> tet{slot(at)};
          for (int step = 0; step < 3; ++step) {
            const int axis = path[step];
            at[axis] += (cell[axis] & 1) ? -1 : 1;
            tet[step + 1] = slot(at);
          }
          if ((path[3] != 0) != mirrored) std::swap(tet[2], tet[3]);
          corners.insert(corners.end(), tet.begin(), tet.end());
        }
      }
    }
  }
  for (std::size_t corner : corners) node_of[corner] = 0;
  for (int k = 0; k < points[2]; ++k) {
    for (int j = 0; j < points[1]; ++j) {
      for (int i = 0; i < points[0]; ++i) {
        std::int32_t& node = node_of[slot({i, j, k})];
        if (node < 0) continue;
        node = static_cast<std::int32_t>(mesh.nodes.size());
        mesh.nodes.push_back(place(i, j, k));
        if (indices) indices->push_back({i, j, k});
      }
    }
  }
  mesh.tets.reserve(corners.size());
  for (std::size_t corner : corners) mesh.tets.push_back(node_of[corner]);
  mesh.regions.assign(corners.size() / 4, 0);
  return mesh;
}

void append_prism(mesh::TetMesh& mesh, std::array<std::int32_t, 3> bottom, std::array<std::int32_t, 3> top) {
  // Sort the three columns; an odd permutation turns the orientation of the triangle.
  bool odd = false;
  const auto order = [&](int a, int b) {
    if (bottom[a] < bottom[b]) return;
    std::swap(bottom[a], bottom[b]);
    std::swap(top[a], top[b]);
    odd = !odd;
  };
  order(0, 1);
  order(1, 2);
  order(0, 1);
  std::array<std::array<std::int32_t, 4>, 3> tets{
      {{bottom[0], bottom[1], bottom[2], top[2]}, {bottom[0], bottom[1], top[2], top[1]}, {bottom[0], top[1], top[2], top[0]}}};
  for (auto& tet : tets) {
    if (odd) std::swap(tet[1], tet[2]);
    mesh.tets.insert(mesh.tets.end(), tet.begin(), tet.end());
    mesh.regions.push_back(0);
  }
}

void raise_order(mesh::TetMesh& mesh, const std::function<Vec3(std::int32_t, std::int32_t)>& place) {
  std::unordered_map<std::uint64_t, std::int32_t> middle_of;
  middle_of.reserve(mesh.nodes.size() * 7);
  std::vector<std::array<std::int32_t, 2>> edges;
  std::vector<std::int32_t> tets;
  const std::int64_t count = mesh.tet_count();
  const std::int32_t corners = static_cast<std::int32_t>(mesh.nodes.size());
  tets.reserve(count * 10);
  for (std::int64_t e = 0; e < count; ++e) {
    const auto tet = mesh.tet(e);
    tets.insert(tets.end(), tet.begin(), tet.end());
    for (const auto& edge : mesh::kEdges) {
      const std::int32_t a = std::min(tet[edge[0]], tet[edge[1]]);
      const std::int32_t b = std::max(tet[edge[0]], tet[edge[1]]);
      const std::uint64_t key = (static_cast<std::uint64_t>(a) << 32) | static_cast<std::uint32_t>(b);
      const auto [entry, is_new] = middle_of.try_emplace(key, static_cast<std::int32_t>(corners + edges.size()));
      if (is_new) edges.push_back({a, b});
      tets.push_back(entry->second);
    }
  }
  for (const auto& [a, b] : edges) mesh.nodes.push_back(place(a, b));
  for (auto& [name, set] : mesh.node_sets) {
    std::vector<bool> in_set(corners, false);
    for (std::int32_t node : set) in_set[node] = true;
    for (std::size_t i = 0; i < edges.size(); ++i) {
      if (in_set[edges[i][0]] && in_set[edges[i][1]]) set.push_back(static_cast<std::int32_t>(corners + i));
    }
  }
  mesh.tets = std::move(tets);
  mesh.order = 2;
}

}  // namespace carillon::shapes
