// Graph compression by dominated vertices: the core determines the separators. In a second-order mesh the core is the corners, an eighth of
// the nodes.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "partition/partition.hpp"

namespace carillon::partition {

/// A graph without its dominated vertices. Vertex u dominates v if they are adjacent and every other neighbour of v is also adjacent to u:
/// a set that separates u from a vertex then separates v from it too, and v can be eliminated before u without additional fill. In a T10
/// mesh the middle of an edge is dominated by both ends. Vertices with the same neighbours dominate each other; the first of them stays.
class CompressedGraph {
 public:
  /// If the core would have fewer than `smallest_core` vertices, or more than half of all, the graph is not compressed.
  explicit CompressedGraph(const Graph& graph, std::int32_t smallest_core = kSmallestCore);
  /// Compresses the node graph of a mesh without building it: u dominates v if it is in all elements of v. A vertex whose neighbours happen
  /// to be shared by another vertex stays in the core. elements: as for make_node_graph(), nodes of an element distinct.
  CompressedGraph(std::span<const std::int32_t> elements, int width, std::int32_t nodes, std::int32_t smallest_core = kSmallestCore);

  /// The graph of the vertices not dominated by another, in their order.
  const Graph& core() const { return core_; }
  /// (vertices) index of each in the core, -1: dominated.
  const std::vector<std::int32_t>& numbers() const { return number_; }
  /// Dominated vertices per edge of the core: 1 in a second-order mesh, where they are the middles of the edges.
  double dominated_per_edge() const;

  /// Expands a separator of the core to the whole graph. side: (core vertices) 0, 1 or 2 (separator); result: the same for all vertices. A
  /// dominated vertex is in the separator only if all its dominators are.
  std::vector<std::int32_t> expand_sides(const std::vector<std::int32_t>& side) const;

  /// Expands an elimination order of the core to the whole graph: a dominated vertex precedes its first dominator, those with few
  /// neighbours first. position: (core vertices) a permutation; result: (vertices) a permutation.
  std::vector<std::int32_t> expand_order(const std::vector<std::int32_t>& position) const;

 private:
  static constexpr std::int32_t kSmallestCore = 64;

  /// dominators, offsets: all dominators of each vertex, in compressed rows. Returns the core vertices; empty if compression is not
  /// worthwhile.
  std::vector<std::int32_t> choose_core(const std::vector<std::int32_t>& offsets, const std::vector<std::int32_t>& dominators,
                                        std::int32_t smallest_core);
  std::int32_t find_first_host(std::int32_t vertex, const std::vector<std::int32_t>& position) const;

  std::vector<std::int32_t> offsets_{0};  // (vertices + 1) of hosts_
  std::vector<std::int32_t> hosts_;       // dominators in the core, per dominated vertex
  std::vector<std::int32_t> number_;      // (vertices) index in the core, -1: dominated
  std::vector<std::int32_t> degree_;      // (vertices) number of neighbours, or of elements: a dominator has at least as many
  Graph core_;
};

/// Number of separators or orders of a core, or part of one, to compute in place of one of the whole graph: the time of METIS depends on
/// the core, that of the factorisation on the graph.
int find_tries(const Graph& core, double dominated_per_edge);

/// Predicted operations of a factorisation in the order made by expand_order, to compare orders: sum of the squared column lengths of L.
/// The dominated vertices of an edge are assigned to its first eliminated end with all its rows, up to twice too many. position: (core
/// vertices) a permutation.
double predict_operations(const Graph& core, double dominated_per_edge, const std::vector<std::int32_t>& position);

}  // namespace carillon::partition
