// In which order the nodes are eliminated: a tree of separators over the ranks, and the fronts of each part of it.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/comm/index_partition.hpp"
#include "precompute/ldlt/node_links.hpp"
#include "precompute/ldlt/symbolic.hpp"

namespace carillon::ldlt {

/// A part of the tree: the leaf of a rank, or the separator between two subtrees. Of the leaves begin to end - 1, and held by rank `begin`:
/// it knows the part's nodes and fronts until they are dealt out.
struct TreePart {
  int begin = 0;
  int end = 1;
  int parent = -1;
  int depth = 0;
  std::int32_t first = 0;  // of its nodes, in the order of elimination
  std::int32_t count = 0;
  std::int32_t first_front = 0;
  bool is_leaf() const { return end - begin == 1; }
};

/// All parts, children before parents; the same on every rank.
struct SeparatorTree {
  std::vector<TreePart> parts;
  std::int32_t fronts = 0;

  /// The part of a position in the order of elimination.
  int find_part(std::int32_t position) const;
  int find_holder(std::int32_t position) const { return parts[static_cast<std::size_t>(find_part(position))].begin; }
};

/// A part on the rank that holds it, eliminated on paper.
struct HeldPart {
  int part = 0;
  Ints nodes;     // (count) global number of the node at each position
  Forest forest;  // pivots and rows are positions of the whole order; `parent` is of this part, -1: see parents
  Ints parents;   // (supernodes) parent front among all, -1: a root
};

/// Where all nodes stand, and the fronts that this rank holds.
struct Elimination {
  SeparatorTree tree;
  Ints position;                // (own and ghost nodes) in the order of elimination
  std::vector<HeldPart> parts;  // children before parents
};

/// Orders the nodes and finds the fronts. Parts of up to `largest_gathered` nodes are gathered on one rank and cut there; larger ones are
/// cut by their quotient graph, and stay where they are. Collective. Throws SystemError on all ranks when memory runs out.
Elimination eliminate_on_paper(const comm::Communicator& comm, const NodeLinks& nodes, const comm::IndexPartition& owners,
                               std::int32_t largest_gathered = 300'000);

}  // namespace carillon::ldlt
