// Method: each cell is cut into Kuhn's six tetrahedra (monotone paths from one corner to the opposite one), mirrored from cell to cell by
//   index parity (J1 triangulation). Neighbours then share face diagonals, and an evenly divided box keeps its three mirror planes, so
//   bending modes of a square bar stay degenerate. A prism is cut along the diagonals from the smallest index, which conforms by
//   construction.
// Source: Kuhn 1960, IBM J. Res. Dev. 4; Todd 1976, "The Computation of Fixed Points and Applications" (J1); Dompierre et al. 1999, "How to
//   subdivide pyramids, prisms and hexahedra into tetrahedra".
#include "precompute/mesh/shapes/lattice.hpp"

#include <algorithm>
#include <cmath>
#include <unordered_map>
#include <utility>

#include "runtime/base/vector.hpp"

namespace carillon::shapes {
namespace {

// The six axis orders of a monotone path, and their parity.
constexpr std::array<std::array<int, 4>, 6> kPaths{{{0, 1, 2, 0}, {1, 2, 0, 0}, {2, 0, 1, 0}, {0, 2, 1, 1}, {2, 1, 0, 1}, {1, 0, 2, 1}}};

void append_tet(mesh::TetMesh& mesh, std::int32_t a, std::int32_t b, std::int32_t c, std::int32_t d) {
  const auto from_a = [&](std::int32_t n) {
    return Vec3{mesh.nodes_m[n][0] - mesh.nodes_m[a][0], mesh.nodes_m[n][1] - mesh.nodes_m[a][1], mesh.nodes_m[n][2] - mesh.nodes_m[a][2]};
  };
  if (calc_det(from_a(b), from_a(c), from_a(d)) < 0.0) std::swap(c, d);
  mesh.tets.insert(mesh.tets.end(), {a, b, c, d});
  mesh.regions.push_back(0);
}

// Four tetrahedra around the shortest diagonal of an octahedron with opposite corners o[i] and o[i + 3].
void append_octahedron(mesh::TetMesh& mesh, const std::array<std::int32_t, 6>& o) {
  int best = 0;
  double best_length = HUGE_VAL;
  for (int i = 0; i < 3; ++i) {
    const double length = norm(mesh.nodes_m[o[i]] - mesh.nodes_m[o[i + 3]]);
    if (length < best_length * (1.0 - 1e-9)) {
      best_length = length;
      best = i;
    }
  }
  const int p = (best + 1) % 3, q = (best + 2) % 3;
  const std::array<std::int32_t, 4> belt{o[p], o[q], o[p + 3], o[q + 3]};
  for (int i = 0; i < 4; ++i) append_tet(mesh, o[best], o[best + 3], belt[i], belt[(i + 1) % 4]);
}

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
  std::vector<std::size_t> corners;  // slots, four per tetrahedron
  for (int k = 0; k < lattice.cells[2]; ++k) {
    for (int j = 0; j < lattice.cells[1]; ++j) {
      for (int i = 0; i < lattice.cells[0]; ++i) {
        if (lattice.keep && !lattice.keep(i, j, k)) continue;
        const std::array<int, 3> cell{i, j, k};
        const bool mirrored = ((i + j + k) & 1) != 0;  // an odd number of mirrored axes reverses the orientation
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
        node = static_cast<std::int32_t>(mesh.nodes_m.size());
        mesh.nodes_m.push_back(place(i, j, k));
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
  // Sort the three columns; an odd permutation reverses the triangle.
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

void append_refined(mesh::TetMesh& mesh, int frequency, const std::function<std::int32_t(int, int, int)>& node,
                    std::vector<std::array<std::int32_t, 3>>* skin) {
  const auto add_to_skin = [&](std::int32_t a, std::int32_t b, std::int32_t c) {
    if (skin != nullptr) skin->push_back({a, b, c});
  };
  for (int a = 0; a < frequency; ++a) {
    for (int b = 0; a + b < frequency; ++b) {
      for (int c = 0; a + b + c < frequency; ++c) {
        const int below = frequency - (a + b + c);  // levels between this cell's first corner and the base
        const std::int32_t n100 = node(a + 1, b, c), n010 = node(a, b + 1, c), n001 = node(a, b, c + 1);
        append_tet(mesh, node(a, b, c), n100, n010, n001);
        if (below == 1) add_to_skin(n100, n010, n001);
        if (below < 2) continue;
        const std::int32_t n110 = node(a + 1, b + 1, c), n101 = node(a + 1, b, c + 1), n011 = node(a, b + 1, c + 1);
        append_octahedron(mesh, {n100, n010, n001, n011, n101, n110});
        if (below == 2) add_to_skin(n110, n011, n101);
        if (below >= 3) append_tet(mesh, node(a + 1, b + 1, c + 1), n110, n101, n011);
      }
    }
  }
}

void raise_order(mesh::TetMesh& mesh, const std::function<Vec3(std::int32_t, std::int32_t)>& place) {
  std::unordered_map<std::uint64_t, std::int32_t> middle_of;
  middle_of.reserve(mesh.nodes_m.size() * 7);
  std::vector<std::array<std::int32_t, 2>> edges;
  std::vector<std::int32_t> tets;
  const std::int64_t count = mesh.tet_count();
  const std::int32_t corners = static_cast<std::int32_t>(mesh.nodes_m.size());
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
  for (const auto& [a, b] : edges) mesh.nodes_m.push_back(place(a, b));
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
