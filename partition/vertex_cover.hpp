// Minimum vertex cover of the edges between two sides.
#pragma once

#include <cstdint>
#include <utility>
#include <vector>

namespace carillon::partition {

/// Minimum vertex cover of a bipartite graph, ascending. edges: (left, right) vertices; the sides are disjoint. As many vertices as edges
/// in a maximum matching (Koenig 1931).
std::vector<std::int32_t> cover_edges(const std::vector<std::pair<std::int32_t, std::int32_t>>& edges);

}  // namespace carillon::partition
