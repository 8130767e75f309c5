// The fewest vertices that hold an end of every edge between two sides.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

namespace carillon::partition {

/// A minimum vertex cover of a bipartite graph, ascending. edges: (left, right) vertices; the sides have no vertex in common.
/// Koenig 1931: as many as a maximum matching has edges.
std::vector<std::int32_t> cover_edges(const std::vector<std::pair<std::int32_t, std::int32_t>>& edges);

}  // namespace carillon::partition
