// Cost of an elimination order, computed by brute force.
#pragma once

#include <cstddef>
#include <cstdint>
#include <set>
#include <vector>

#include "partition/partition.hpp"

namespace carillon::partition {

/// Vertices behind each position of an order in its column of the Cholesky factor, by symbolic elimination.
inline std::vector<std::size_t> count_below(const Graph& graph, const std::vector<std::int32_t>& position) {
  const int n = graph.vertex_count();
  std::vector<std::set<std::int32_t>> later(n);  // by position
  for (int v = 0; v < n; ++v)
    for (int k = graph.offsets[v]; k < graph.offsets[v + 1]; ++k)
      if (position[graph.neighbours[k]] > position[v]) later[position[v]].insert(position[graph.neighbours[k]]);
  std::vector<std::size_t> below;
  for (int p = 0; p < n; ++p) {
    below.push_back(later[p].size());
    if (later[p].empty()) continue;
    const int parent = *later[p].begin();
    later[parent].insert(std::next(later[p].begin()), later[p].end());
  }
  return below;
}

/// Entries of the factor.
inline std::size_t count_factor_entries(const Graph& graph, const std::vector<std::int32_t>& position) {
  std::size_t entries = 0;
  for (const std::size_t below : count_below(graph, position)) entries += 1 + below;
  return entries;
}

/// Sum of the squared column lengths.
inline double count_factor_operations(const Graph& graph, const std::vector<std::int32_t>& position) {
  double operations = 0;
  for (const std::size_t below : count_below(graph, position)) operations += static_cast<double>(below * below);
  return operations;
}

}  // namespace carillon::partition
