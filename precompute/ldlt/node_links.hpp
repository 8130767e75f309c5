// Neighbours of the nodes of a rank.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/comm/exchange.hpp"
#include "precompute/comm/index_partition.hpp"
#include "precompute/la/node_rows.hpp"

namespace carillon::ldlt {

using Ints = std::vector<std::int32_t>;
using la::NodeRows;

/// Concatenated integer lists of varying length.
struct Ragged {
  Ints offsets{0};
  Ints items;
  std::int32_t count() const { return static_cast<std::int32_t>(offsets.size()) - 1; }
  const std::int32_t* begin(std::int32_t i) const { return items.data() + offsets[i]; }
  const std::int32_t* end(std::int32_t i) const { return items.data() + offsets[i + 1]; }
  void close() { offsets.push_back(static_cast<std::int32_t>(items.size())); }
};

/// Neighbours of this rank's nodes: numbers below own_nodes are local, own_nodes + g is the ghost node ghosts[g].
struct NodeLinks {
  std::int32_t first_node = 0;
  std::int32_t own_nodes = 0;
  Ints ghosts;   // global, ascending
  Ragged links;  // (own_nodes) ascending, without the node itself

  std::int32_t count() const { return own_nodes + static_cast<std::int32_t>(ghosts.size()); }
  std::int32_t find_global(std::int32_t v) const { return v < own_nodes ? first_node + v : ghosts[v - own_nodes]; }
  /// Pre: `node` is a ghost.
  std::int32_t find_ghost(std::int32_t node) const;
};

/// Union of the patterns of K and M, in nodes. Throws InputError if their rows differ. Local.
NodeLinks find_links(const NodeRows& k, const NodeRows& m);

/// Values of ghost nodes, from their owners; own: (own_nodes). Collective.
template <comm::Plain T>
std::vector<T> fetch_ghosts(const comm::Communicator& comm, const NodeLinks& nodes, const comm::IndexPartition& owners,
                            const std::vector<T>& own) {
  return comm::query_owners<T>(
      comm, nodes.ghosts, [&](std::int32_t node) { return owners.find_owner(node); },
      [&](std::int32_t node) { return own[owners.to_local(node)]; });
}

}  // namespace carillon::ldlt
