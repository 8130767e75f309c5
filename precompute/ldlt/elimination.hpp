// The fronts of all nodes, found on paper by the ranks that hold the parts of the separator tree.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "partition/dissect.hpp"
#include "precompute/ldlt/order.hpp"
#include "precompute/ldlt/symbolic.hpp"

namespace carillon::ldlt {

/// A part on the rank that holds it, eliminated on paper.
struct HeldPart {
  int part = 0;
  Ints nodes;     // (count) global number of the node at each position
  Forest forest;  // pivots and rows are positions of the whole order; `parent` is of this part, -1: see parents
  Ints parents;   // (supernodes) parent front among all, -1: a root
};

/// Where all nodes stand, and the fronts that this rank holds.
struct Elimination {
  explicit Elimination(int ranks) : tree(ranks) {}
  SeparatorTree tree;
  Ints position;                // (own and ghost nodes) in the order of elimination
  std::vector<HeldPart> parts;  // children before parents
};

/// Positions of own nodes and ghosts, from the ranks that hold them. Collective.
Ints report_positions(const comm::Communicator& comm, const Elimination& all, const NodeLinks& nodes, const comm::IndexPartition& owners);

/// Orders the nodes of a mesh whose elements are all on rank 0, and finds the fronts. elements: (e, width) of nodes 0 to nodes - 1,
/// negative: none; on the other ranks nodes is 0. Rank 0 has all positions afterwards. Collective. Throws SystemError on all ranks when
/// memory runs out.
Elimination eliminate_elements(const comm::Communicator& comm, std::span<const std::int32_t> elements, int width, std::int32_t nodes);

/// Orders the nodes and finds the fronts. largest_gathered: of order_parts. Collective. Throws SystemError on all ranks when memory runs
/// out.
Elimination eliminate_on_paper(const comm::Communicator& comm, const NodeLinks& nodes, const comm::IndexPartition& owners,
                               std::int32_t largest_gathered = partition::kLargestGathered);

}  // namespace carillon::ldlt
