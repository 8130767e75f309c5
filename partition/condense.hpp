// The few vertices of a graph that decide its separators: in a mesh of second order the corners, an eighth of the nodes.
#pragma once

#include <cstdint>
#include <vector>

#include "partition/partition.hpp"

namespace carillon::partition {

/// A graph without its dominated vertices. Vertex u dominates v if they are neighbours and every other neighbour of v is one of u too: what
/// separates u from a vertex then separates v from it, and v can be eliminated before u without a link that u would not have. In a mesh of
/// T10 the middle of an edge is dominated by both ends. Vertices with the same neighbours dominate each other; the first of them stays.
class Condensation {
 public:
  /// graph: has to outlive this. One whose core would have less than `smallest_core` vertices, or more than
  /// half of them, is its own core.
  explicit Condensation(const Graph& graph, std::int32_t smallest_core = 64);

  /// The graph of the vertices that no other dominates, in their order.
  const Graph& core() const { return core_; }

  /// How many separators or orders of the core to seek where one would be sought of the graph: METIS's time goes with the core, that of the
  /// factorisation with the graph.
  int find_tries() const { return 4 * core_.vertex_count() <= graph_.vertex_count() ? 4 : 1; }

  /// A separator of the whole graph from one of the core. side: (core vertices) 0, 1 or 2, the separator; the same for every vertex of
  /// the graph. A dominated vertex is in the separator only if all are that dominate it.
  std::vector<std::int32_t> expand_sides(const std::vector<std::int32_t>& side) const;

  /// An order of elimination of the whole graph from one of the core: a dominated vertex comes before the first that dominates it, those
  /// with few neighbours first. position: (core vertices) a permutation; result: (vertices) a permutation.
  std::vector<std::int32_t> expand_order(const std::vector<std::int32_t>& position) const;
  /// Squares of the lengths of the columns of L, summed, in the order that expand_order makes of this one: operations, to compare orders
  /// by. What comes before a vertex of the core counts as if it had all the rows of that vertex, which is up to twice too much.
  double estimate_operations(const std::vector<std::int32_t>& position) const;

 private:
  std::int32_t find_first_host(std::int32_t vertex, const std::vector<std::int32_t>& position) const;

  const Graph& graph_;
  std::vector<std::int32_t> offsets_{0};  // (vertices + 1) of hosts_
  std::vector<std::int32_t> hosts_;       // per dominated vertex the vertices of the core that dominate it
  std::vector<std::int32_t> number_;      // (vertices) in the core, -1: dominated
  Graph core_;
};

}  // namespace carillon::partition
