// The few vertices of a graph that decide its separators: in a mesh of second order the corners, an eighth of the nodes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "partition/partition.hpp"

namespace carillon::partition {

/// A graph without its dominated vertices. Vertex u dominates v if they are neighbours and every other neighbour of v is one of u too: what
/// separates u from a vertex then separates v from it, and v can be eliminated before u without a link that u would not have. In a mesh of
/// T10 the middle of an edge is dominated by both ends. Vertices with the same neighbours dominate each other; the first of them stays.
class Condensation {
 public:
  /// One whose core would have fewer than `smallest_core` vertices, or more than half of them, is its own core.
  explicit Condensation(const Graph& graph, std::int32_t smallest_core = kSmallestCore);
  /// Of the node graph of a mesh, which is not made: u dominates v if it is in all elements of v. So a vertex whose neighbours another one
  /// happens to have as well stays in the core. elements: as make_node_graph(), each with different nodes.
  Condensation(std::span<const std::int32_t> elements, int width, std::int32_t nodes, std::int32_t smallest_core = kSmallestCore);

  /// The graph of the vertices that no other dominates, in their order.
  const Graph& core() const { return core_; }
  /// (vertices) the number of each in the core, -1: dominated.
  const std::vector<std::int32_t>& numbers() const { return number_; }
  /// Dominated vertices for each edge of the core: 1 in a mesh of second order, where they are the middles of the edges.
  double dominated_per_edge() const;

  /// A separator of the whole graph from one of the core. side: (core vertices) 0, 1 or 2, the separator; the same for every vertex of
  /// the graph. A dominated vertex is in the separator only if all are that dominate it.
  std::vector<std::int32_t> expand_sides(const std::vector<std::int32_t>& side) const;

  /// An order of elimination of the whole graph from one of the core: a dominated vertex comes before the first that dominates it, those
  /// with few neighbours first. position: (core vertices) a permutation; result: (vertices) a permutation.
  std::vector<std::int32_t> expand_order(const std::vector<std::int32_t>& position) const;

 private:
  static constexpr std::int32_t kSmallestCore = 64;

  /// dominators, offsets: all that dominate each vertex, in compressed rows. The vertices of the core; empty: it is not worth it.
  std::vector<std::int32_t> choose_core(const std::vector<std::int32_t>& offsets, const std::vector<std::int32_t>& dominators,
                                        std::int32_t smallest_core);
  std::int32_t find_first_host(std::int32_t vertex, const std::vector<std::int32_t>& position) const;

  std::vector<std::int32_t> offsets_{0};  // (vertices + 1) of hosts_
  std::vector<std::int32_t> hosts_;       // per dominated vertex the vertices of the core that dominate it
  std::vector<std::int32_t> number_;      // (vertices) in the core, -1: dominated
  std::vector<std::int32_t> degree_;      // (vertices) neighbours, or elements: who dominates another has no fewer
  Graph core_;
};

/// How many separators or orders of a core, or of a part of one, to seek where one would be sought of the whole graph: METIS's time goes
/// with the core, that of the factorisation with the graph.
int find_tries(const Graph& core, double dominated_per_edge);

/// Operations of a factorisation in the order that expand_order makes of this one, to compare orders by: squares of the lengths of the
/// columns of L, summed. The dominated vertices of each edge go with the end that is eliminated first, as if they had all its rows, which
/// is up to twice too much. position: (core vertices) a permutation.
double estimate_operations(const Graph& core, double dominated_per_edge, const std::vector<std::int32_t>& position);

}  // namespace carillon::partition
