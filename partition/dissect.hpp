// Separators between the parts of a graph, as a tree: an order of elimination whose upper levels many ranks can share.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "partition/partition.hpp"

namespace carillon::partition {

/// Vertices of a graph, or of a part of it, that one process cuts: larger parts are cut with up to a quarter more operations.
inline constexpr std::int32_t kLargestGathered = 1'000'000;

/// A graph whose vertices and links count more or less.
struct WeightedGraph {
  Graph graph{{0}, {}};
  std::vector<std::int32_t> weights;  // (vertices)
  std::vector<std::int32_t> links;    // (2 edges) as the neighbours
};

/// 0 and 1, the sides, or 2, the separator between them, for each vertex: the smallest of `tries` found. Sides may be a fifth apart.
/// Another seed finds others. dominated_per_edge: as order_nested_dissection. Throws SystemError when METIS runs out of memory, as all
/// below.
std::vector<std::int32_t> separate(const Graph& graph, int tries = 4, int seed = 0, std::optional<double> dominated_per_edge = {});

/// Vertices in `count` clusters of nearly equal size with few edges between them: the cluster of each.
std::vector<std::int32_t> make_clusters(const Graph& graph, std::int32_t count);

/// 0 or 1 for each vertex; side 0 has `left` of the weight, and the edges cut weigh little.
std::vector<std::int32_t> halve(const WeightedGraph& graph, double left);

/// A binary tree of separators over `parts` leaves.
struct Dissection {
  std::vector<std::int32_t> position;   // (vertices) place in the order of elimination: left, right, then their separator
  std::vector<std::int32_t> separator;  // (parts - 1) vertices of each, children before parents
};

/// Cuts the graph into `parts` leaves (>= 1) by separators and orders them. Up to `largest_gathered` vertices a part is cut as it is; a
/// larger one by a quotient graph of clusters and the smallest vertex cover of the edges cut, so that where the graph is distributed, only
/// clusters and cut edges have to be gathered. Leaves and separators are ordered by nested dissection. The same input gives the same
/// answer. Throws SystemError when METIS runs out of memory.
Dissection dissect(const Graph& graph, int parts, std::int32_t largest_gathered = kLargestGathered);

}  // namespace carillon::partition
