// A rank's own nodes: who their neighbours are, which of them separate it from others, and how the rest is eliminated.
#pragma once

#include <mpi.h>

#include <cstdint>
#include <vector>

#include "precompute/ldlt/interface.hpp"
#include "precompute/ldlt/local_rows.hpp"

namespace carillon::ldlt {

/// Neighbours of this rank's nodes: numbers below own_nodes are this rank's, own_nodes + g is the node ghosts[g] of another.
struct NodeLinks {
  std::int32_t first_node = 0;
  std::int32_t own_nodes = 0;
  Ints ghosts;  // global, ascending
  Lists links;  // (own_nodes) ascending, without the node itself
};

/// The union of the patterns of K and M, in nodes. Throws InputError when their rows differ. Local.
NodeLinks find_links(const LocalRows& k, const LocalRows& m);

/// Gathers the interface nodes, who they touch, and orders them. rank_starts: (ranks + 1) first node of each rank. is_interface: (own and
/// ghost nodes). Collective.
Interface gather_interface(MPI_Comm comm, const NodeLinks& nodes, const Ints& rank_starts, std::vector<bool>& is_interface);

/// The interior of this rank, eliminated on paper.
struct Interior {
  Ints own_node;  // (interior nodes) by final position
  Ints boundary;  // first interface positions next to the interior, ascending
  Forest forest;  // rows from interior nodes on: boundary entries
};

/// Orders the interior by METIS and finds its supernodes. Local.
Interior plan_interior(const NodeLinks& nodes, const Interface& interface, const std::vector<bool>& is_interface);

}  // namespace carillon::ldlt
