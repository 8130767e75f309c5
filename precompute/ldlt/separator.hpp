// The nodes that separate the ranks: gathered, ordered and planned on every rank alike.
#pragma once

#include <mpi.h>

#include <cstdint>
#include <vector>

#include "precompute/ldlt/symbolic.hpp"

namespace carillon::ldlt {

using Ints = std::vector<std::int32_t>;

/// Ragged of integers, one after the other.
struct Ragged {
  Ints offsets{0};
  Ints items;
  std::int32_t count() const { return static_cast<std::int32_t>(offsets.size()) - 1; }
  const std::int32_t* begin(std::int32_t i) const { return items.data() + offsets[i]; }
  const std::int32_t* end(std::int32_t i) const { return items.data() + offsets[i + 1]; }
  void close() { offsets.push_back(static_cast<std::int32_t>(items.size())); }
};

/// The lists of all ranks in order of rank. first_of_rank: (ranks + 1) where each rank's begin. Collective.
Ragged gather_ragged(MPI_Comm comm, const Ragged& own, Ints& first_of_rank);

/// The rank whose part holds `item`; starts: (ranks + 1) where the parts begin.
int find_rank(const Ints& starts, std::int32_t item);

/// Separator nodes are numbered first by their global numbers (`index`), then by the order of elimination (`position`).
struct Separator {
  Ints nodes;             // (I) global node of each index, ascending
  Ints first_of_rank;     // (ranks + 1) first index of each rank
  Ragged links;           // (I) neighbouring separator nodes: indices
  Ragged adjacent_ranks;  // (I) ranks that have subdomain neighbours of the node, ascending
  Ints position;          // (I) by index
  Ints index;             // (I) by position

  Ragged elements;  // rows that each root of a subdomain forest leaves: positions, ascending
  Ints element_rank;
  Forest forest;  // of positions
  Ints owner;     // (supernodes) rank

  std::int32_t find(std::int32_t global_node) const;  // index, -1: not a separator node
  std::int32_t count() const { return static_cast<std::int32_t>(nodes.size()); }
};

/// The separator: a small set of nodes that holds one end of every edge between ranks. edges: one list for each node of this rank with
/// neighbours on higher ranks, the node and then those neighbours, global numbers. rank_starts: (ranks + 1) first node of each rank. Fills
/// nodes and first_of_rank. Collective.
void find_separator(MPI_Comm comm, const Ragged& edges, const Ints& rank_starts, Separator& separator);

/// A first elimination order: nodes between the same ranks stay together, such groups go by approximate minimum degree. Fills position and
/// index. Local, and the same on every rank.
void order_separator(Separator& separator);

/// Eliminates the separator on paper: supernodes (which refines the order) and their ranks. elements hold first positions; entries: what
/// each rank keeps of L already. Local, and the same on every rank.
void plan_separator(Separator& separator, std::vector<double> entries);

/// The positions with which a rank has to do: its own separator nodes with their neighbours, the boundary of its subdomain, and the fronts
/// that it owns. Ascending.
Ints find_touched_positions(const Separator& separator, int rank);

}  // namespace carillon::ldlt
