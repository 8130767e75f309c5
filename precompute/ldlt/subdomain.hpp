// A rank's own nodes: who their neighbours are, which of them separate it from others, and how the rest is eliminated.
#pragma once

#include <mpi.h>

#include <cstdint>
#include <vector>

#include "precompute/la/node_rows.hpp"
#include "precompute/ldlt/separator.hpp"

namespace carillon::ldlt {

using la::NodeRows;

/// Neighbours of this rank's nodes: numbers below own_nodes are this rank's, own_nodes + g is the node ghosts[g] of another.
struct NodeLinks {
  std::int32_t first_node = 0;
  std::int32_t own_nodes = 0;
  Ints ghosts;   // global, ascending
  Ragged links;  // (own_nodes) ascending, without the node itself
};

/// The union of the patterns of K and M, in nodes. Throws InputError when their rows differ. Local.
NodeLinks find_links(const NodeRows& k, const NodeRows& m);

/// Gathers the separator nodes, who they touch, and orders them. rank_starts: (ranks + 1) first node of each rank. is_separator: (own and
/// ghost nodes). Collective.
Separator gather_separator(MPI_Comm comm, const NodeLinks& nodes, const Ints& rank_starts, std::vector<bool>& is_separator);

/// The subdomain of this rank, eliminated on paper.
struct Subdomain {
  Ints own_node;  // (subdomain nodes) by final position
  Ints boundary;  // first separator positions next to the subdomain, ascending
  Forest forest;  // rows from subdomain nodes on: boundary entries
};

/// Orders the subdomain by METIS and finds its supernodes. Local.
Subdomain plan_subdomain(const NodeLinks& nodes, const Separator& separator, const std::vector<bool>& is_separator);

}  // namespace carillon::ldlt
