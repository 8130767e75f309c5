// Symbolic elimination of all nodes by the ranks that hold the parts of the separator tree.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "partition/dissect.hpp"
#include "precompute/ldlt/order.hpp"
#include "precompute/ldlt/symbolic.hpp"

namespace carillon::ldlt {

/// A part of the separator tree on its holder, after symbolic elimination.
struct HeldPart {
  int part = 0;
  Ints nodes;     // (count) global node number at each position
  Forest forest;  // pivots and rows are global positions; `parent` is within this part, -1: see parents
  Ints parents;   // (supernodes) global id of the parent front, -1: a root
};

/// Positions of all nodes, and the fronts held by this rank.
struct Elimination {
  explicit Elimination(int ranks) : tree(ranks) {}
  SeparatorTree tree;
  Ints position;                // (own and ghost nodes) in the elimination order
  std::vector<HeldPart> parts;  // children before parents
};

/// Positions of own and ghost nodes, from the ranks that hold them. Collective.
Ints report_positions(const comm::Communicator& comm, const Elimination& all, const NodeLinks& nodes, const comm::IndexPartition& owners);

/// Orders the nodes of a mesh whose elements are all on rank 0, and finds the fronts. elements: (e, width) node numbers 0 to nodes - 1,
/// negative: none; on other ranks nodes is 0. Afterwards rank 0 has all positions. Collective. Throws SystemError on all ranks if memory
/// runs out.
Elimination eliminate_elements(const comm::Communicator& comm, std::span<const std::int32_t> elements, int width, std::int32_t nodes);

/// Orders the nodes and finds the fronts. largest_gathered: see order_parts. Collective. Throws SystemError on all ranks if memory runs
/// out.
Elimination eliminate_on_paper(const comm::Communicator& comm, const NodeLinks& nodes, const comm::IndexPartition& owners,
                               std::int32_t largest_gathered = partition::kLargestGathered);

}  // namespace carillon::ldlt
