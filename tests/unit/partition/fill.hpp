// What an order of elimination costs, found the slow way.
#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <vector>

#include "partition/partition.hpp"

namespace carillon::partition {

/// Entries of the Cholesky factor under an order, by symbolic elimination.
inline std::size_t count_factor_entries(const Graph& graph, const std::vector<std::int32_t>& position) {
  const int n = graph.vertex_count();
  std::vector<std::set<std::int32_t>> later(n);  // by position
  for (int v = 0; v < n; ++v)
    for (int k = graph.offsets[v]; k < graph.offsets[v + 1]; ++k)
      if (position[graph.neighbours[k]] > position[v]) later[position[v]].insert(position[graph.neighbours[k]]);
  std::size_t entries = n;
  for (int p = 0; p < n; ++p) {
    entries += later[p].size();
    if (later[p].empty()) continue;
    const int parent = *later[p].begin();
    later[parent].insert(std::next(later[p].begin()), later[p].end());
  }
  return entries;
}

}  // namespace carillon::partition
