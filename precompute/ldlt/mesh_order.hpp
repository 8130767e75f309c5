// The order of elimination of a mesh whose rows are not dealt yet.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/comm/index_partition.hpp"
#include "precompute/ldlt/deal.hpp"

namespace carillon::ldlt {

/// Where elements go, and where they stand in the order of elimination.
struct ElementRanks {
  Ints rank;  // (e) that eliminates the first of the element's nodes, of a shared front the one with the diagonal tile; -1: all are fixed
  Ints position;  // (e) of that node
};

/// The separator tree of a mesh and the ranks that eliminate its nodes, found before the mesh is cut: elements can then go to the ranks
/// that eliminate their nodes, and right-hand sides need not travel in a solve.
///
///   MeshOrder order(comm, elements, 10, owners);
///   const Ints part = order.find_ranks(comm, elements, 10).rank;  // cut the mesh so, and number its rows
///   order.renumber(comm, rows);                                   // for Factor(pencil, &order)
class MeshOrder {
 public:
  /// elements: (e, width) nodes of this rank's elements, each element on one rank; negative: fixed. owners: who answers for which node
  /// until the rows are numbered; anyone may. Collective. Throws SystemError on all ranks when memory runs out.
  MeshOrder(const comm::Communicator& comm, std::span<const std::int32_t> elements, int width, const comm::IndexPartition& owners);

  /// Of this rank's elements. Nodes that one rank eliminates alone have all their elements there. Pre: not renumbered. Collective.
  ElementRanks find_ranks(const comm::Communicator& comm, std::span<const std::int32_t> elements, int width) const;

  /// row: for each of the nodes that this rank answers for its row among those of K, in nodes. Once. Collective.
  void renumber(const comm::Communicator& comm, const Ints& row);

  std::int64_t node_count() const { return owners_.total(); }
  /// By the numbers of the rows. Throws std::logic_error before renumber().
  const MappedFronts& get_fronts() const;

 private:
  comm::IndexPartition owners_;
  MappedFronts fronts_;
  Ints rank_;  // (own nodes) who eliminates each; until the rows are numbered
  bool is_numbered_ = false;
};

}  // namespace carillon::ldlt
