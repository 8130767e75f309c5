// Separators between the parts of a graph, as a tree: an order of elimination whose upper levels many ranks can share.
#pragma once

#include <cstdint>
#include <vector>

#include "partition/partition.hpp"

namespace carillon::partition {

/// A binary tree of separators over `parts` leaves.
struct Dissection {
  std::vector<std::int32_t> position;   // (vertices) place in the order of elimination: left, right, then their separator
  std::vector<std::int32_t> separator;  // (parts - 1) vertices of each, children before parents
};

/// Cuts the graph into `parts` leaves (>= 1) by separators and orders them. Up to `largest_gathered` vertices a part is cut as it is; a
/// larger one by a quotient graph of clusters and the smallest vertex cover of the edges cut, so that where the graph is distributed, only
/// clusters and cut edges have to be gathered. Leaves and separators are ordered by nested dissection. The same input gives the same
/// answer. Throws SystemError when METIS runs out of memory.
Dissection dissect(const Graph& graph, int parts, std::int32_t largest_gathered = 300'000);

}  // namespace carillon::partition
