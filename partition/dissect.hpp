// Tree of separators between the parts of a graph: an elimination order whose upper levels many ranks can share.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "partition/partition.hpp"

namespace carillon::partition {

/// Largest graph cut by one process; larger ones are cut with up to a quarter more operations.
inline constexpr std::int32_t kLargestGathered = 1'000'000;

/// A graph with weights of vertices and links.
struct WeightedGraph {
  Graph graph{{0}, {}};
  std::vector<std::int32_t> weights;  // (vertices)
  std::vector<std::int32_t> links;    // (2 edges) in the order of the neighbours
};

/// Side of each vertex, 0 or 1, or 2 for the separator: the smallest of `tries` separators. Sides may differ by a fifth. Different seeds
/// give different separators. dominated_per_edge: as for order_nested_dissection. This and the functions below throw SystemError if METIS
/// runs out of memory.
std::vector<std::int32_t> separate(const Graph& graph, int tries = 4, int seed = 0, std::optional<double> dominated_per_edge = {});

/// Cluster of each vertex: `count` clusters of nearly equal size with few edges between them.
std::vector<std::int32_t> make_clusters(const Graph& graph, std::int32_t count);

/// Side of each vertex, 0 or 1; side 0 has the fraction `left` of the weight, and the cut edges have little weight.
std::vector<std::int32_t> halve(const WeightedGraph& graph, double left);

/// A binary tree of separators over `parts` leaves.
struct Dissection {
  std::vector<std::int32_t> position;   // (vertices) position in the elimination order: left, right, then their separator
  std::vector<std::int32_t> separator;  // (parts - 1) size of each separator, children before parents
};

/// Cuts the graph into `parts` leaves (>= 1) by separators and orders them. A part of up to `largest_gathered` vertices is cut directly; a
/// larger one by a quotient graph of clusters and a minimum vertex cover of the cut edges, so that in a distributed graph only clusters and
/// cut edges are gathered. Leaves and separators are ordered by nested dissection. Deterministic. Throws SystemError if METIS runs out of
/// memory.
Dissection dissect(const Graph& graph, int parts, std::int32_t largest_gathered = kLargestGathered);

}  // namespace carillon::partition
