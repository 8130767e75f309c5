// Method: edges are bucketed by smaller corner; each gets one mid node, numbered after the corners in edge order.

#include <algorithm>

#include "precompute/mesh/check.hpp"

namespace carillon::mesh {

TetMesh to_quadratic(const TetMesh& mesh) {
  if (mesh.order == 2) return mesh;
  TetMesh fine;
  fine.order = 2;
  fine.nodes_m = mesh.nodes_m;
  fine.doubt_m = mesh.doubt_m;
  fine.regions = mesh.regions;
  fine.region_names = mesh.region_names;
  fine.node_sets = mesh.node_sets;
  const std::size_t count = mesh.tet_count();
  fine.tets.resize(10 * count);
  struct Edge {
    std::int32_t high;
    std::int64_t slot;  // index of its mid node in fine.tets
  };
  std::vector<std::size_t> begin(mesh.nodes_m.size() + 1, 0);
  const auto corners = [&](std::size_t e, std::size_t k) {
    const auto tet = mesh.tet(static_cast<std::int64_t>(e));
    return std::minmax(tet[kEdges[k][0]], tet[kEdges[k][1]]);
  };
  for (std::size_t e = 0; e < count; ++e)
    for (std::size_t k = 0; k < 6; ++k) ++begin[corners(e, k).first + 1];
  for (std::size_t i = 1; i < begin.size(); ++i) begin[i] += begin[i - 1];
  std::vector<Edge> edges(6 * count);
  std::vector<std::size_t> next(begin.begin(), begin.end() - 1);
  for (std::size_t e = 0; e < count; ++e) {
    std::copy_n(mesh.tet(static_cast<std::int64_t>(e)).begin(), 4, fine.tets.begin() + static_cast<std::ptrdiff_t>(10 * e));
    for (std::size_t k = 0; k < 6; ++k) {
      const auto [low, high] = corners(e, k);
      edges[next[low]++] = {high, static_cast<std::int64_t>(10 * e + 4 + k)};
    }
  }
  std::vector<std::array<std::int32_t, 2>> ends;  // of each mid node
  for (std::size_t low = 0; low + 1 < begin.size(); ++low) {
    const auto first = edges.begin() + static_cast<std::ptrdiff_t>(begin[low]);
    const auto last = edges.begin() + static_cast<std::ptrdiff_t>(begin[low + 1]);
    std::sort(first, last, [](const Edge& x, const Edge& y) { return x.high < y.high || (x.high == y.high && x.slot < y.slot); });
    for (auto edge = first; edge != last; ++edge) {
      if (edge == first || edge->high != (edge - 1)->high) {
        const Vec3 a = mesh.nodes_m[low], b = mesh.nodes_m[edge->high];
        fine.nodes_m.push_back({0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1]), 0.5 * (a[2] + b[2])});
        if (!mesh.doubt_m.empty()) {
          const Vec3 &p = mesh.doubt_m[low], &q = mesh.doubt_m[edge->high];
          fine.doubt_m.push_back({0.5 * (p[0] + q[0]), 0.5 * (p[1] + q[1]), 0.5 * (p[2] + q[2])});
        }
        ends.push_back({static_cast<std::int32_t>(low), edge->high});
      }
      fine.tets[edge->slot] = static_cast<std::int32_t>(fine.nodes_m.size()) - 1;
    }
  }
  std::vector<char> inside(mesh.nodes_m.size());
  for (auto& [name, set] : fine.node_sets) {
    std::fill(inside.begin(), inside.end(), 0);
    for (const auto node : mesh.node_sets.at(name)) inside[node] = 1;
    for (std::size_t m = 0; m < ends.size(); ++m)
      if (inside[ends[m][0]] != 0 && inside[ends[m][1]] != 0) set.push_back(static_cast<std::int32_t>(mesh.nodes_m.size() + m));
  }
  return fine;
}

TetMesh to_linear(const TetMesh& mesh) {
  if (mesh.order == 1) return mesh;
  TetMesh coarse;
  coarse.order = 1;
  coarse.regions = mesh.regions;
  coarse.region_names = mesh.region_names;
  std::vector<std::int32_t> number(mesh.nodes_m.size(), -1);
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
    for (std::size_t k = 0; k < 4; ++k) number[mesh.tet(e)[k]] = 0;
  for (std::size_t i = 0; i < number.size(); ++i)
    if (number[i] == 0) {
      number[i] = static_cast<std::int32_t>(coarse.nodes_m.size());
      coarse.nodes_m.push_back(mesh.nodes_m[i]);
      if (!mesh.doubt_m.empty()) coarse.doubt_m.push_back(mesh.doubt_m[i]);
    }
  coarse.tets.reserve(4 * mesh.tet_count());
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
    for (std::size_t k = 0; k < 4; ++k) coarse.tets.push_back(number[mesh.tet(e)[k]]);
  for (const auto& [name, set] : mesh.node_sets) {
    auto& kept = coarse.node_sets[name];
    for (const auto node : set)
      if (number[node] >= 0) kept.push_back(number[node]);
  }
  return coarse;
}

}  // namespace carillon::mesh
