// Structured boxes of tetrahedra: nx x ny x nz cells, each cut into the six tetrahedra of Kuhn that share its main diagonal.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "precompute/mesh/tet_mesh.hpp"

namespace carillon::tests {

/// Box [0, size] of order 1 or 2 (mid-side nodes at the edge midpoints), positively oriented.
inline mesh::TetMesh make_box(std::array<int, 3> cells, std::array<double, 3> size_m, int order = 1, std::array<double, 3> origin_m = {}) {
  mesh::TetMesh box;
  const auto id = [&](int i, int j, int k) { return static_cast<std::int32_t>((k * (cells[1] + 1) + j) * (cells[0] + 1) + i); };
  for (int k = 0; k <= cells[2]; ++k)
    for (int j = 0; j <= cells[1]; ++j)
      for (int i = 0; i <= cells[0]; ++i)
        box.nodes_m.push_back(
            {origin_m[0] + size_m[0] * i / cells[0], origin_m[1] + size_m[1] * j / cells[1], origin_m[2] + size_m[2] * k / cells[2]});
  std::map<std::pair<std::int32_t, std::int32_t>, std::int32_t> middle;
  box.order = order;
  for (int k = 0; k < cells[2]; ++k)
    for (int j = 0; j < cells[1]; ++j)
      for (int i = 0; i < cells[0]; ++i) {
        std::array<int, 3> axes{0, 1, 2};
        do {  // one tetrahedron per axis path between the ends of the diagonal
          std::array<int, 3> at{i, j, k};
          std::array<std::int32_t, 4> tet{id(i, j, k)};
          for (int step = 0; step < 3; ++step) {
            ++at[axes[step]];
            tet[step + 1] = id(at[0], at[1], at[2]);
          }
          const bool even = (axes[1] - axes[0] + 3) % 3 == 1;
          if (!even) std::swap(tet[1], tet[2]);
          box.tets.insert(box.tets.end(), tet.begin(), tet.end());
          box.regions.push_back(0);
          if (order == 1) continue;
          for (const auto& edge : mesh::kEdges) {
            const auto key = std::minmax(tet[edge[0]], tet[edge[1]]);
            const auto [found, is_new] = middle.try_emplace(key, static_cast<std::int32_t>(box.nodes_m.size()));
            if (is_new) {
              const auto a = box.nodes_m[key.first], b = box.nodes_m[key.second];
              box.nodes_m.push_back({(a[0] + b[0]) / 2, (a[1] + b[1]) / 2, (a[2] + b[2]) / 2});
            }
            box.tets.push_back(found->second);
          }
        } while (std::next_permutation(axes.begin(), axes.end()));
      }
  return box;
}

}  // namespace carillon::tests
