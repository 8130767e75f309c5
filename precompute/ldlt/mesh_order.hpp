// Elimination order of a mesh before its rows are distributed.
#pragma once

#include <cstdint>
#include <span>

#include "precompute/comm/communicator.hpp"
#include "precompute/comm/index_partition.hpp"
#include "precompute/ldlt/deal.hpp"

namespace carillon::ldlt {

/// Target ranks of elements and their positions in the elimination order.
struct ElementRanks {
  Ints rank;  // (e) that eliminates the first node of the element; for a shared front the owner of the diagonal tile; -1: all nodes fixed
  Ints position;  // (e) of that node
};

/// Separator tree of a mesh and the ranks that eliminate its nodes, computed before the mesh is distributed: elements can then be sent to
/// the ranks that eliminate their nodes, and right-hand sides need not be communicated in a solve.
///
///   MeshOrder order(comm, elements, 10, owners);
///   const Ints part = order.find_ranks(comm, elements, 10).rank;  // distribute the mesh accordingly and number its rows
///   order.renumber(comm, rows);                                   // for Factor(pencil, &order)
class MeshOrder {
 public:
  /// elements: (e, width) nodes of this rank's elements, each element on one rank; negative: fixed. owners: temporary owner of each node
  /// until the rows are numbered; any partition. Collective. Throws SystemError on all ranks if memory runs out.
  MeshOrder(const comm::Communicator& comm, std::span<const std::int32_t> elements, int width, const comm::IndexPartition& owners);

  /// Ranks of this rank's elements. All elements of a node that one rank eliminates alone go to that rank. Pre: not renumbered. Collective.
  ElementRanks find_ranks(const comm::Communicator& comm, std::span<const std::int32_t> elements, int width) const;

  /// row: for each node owned here its row block of K. Call once. Collective.
  void renumber(const comm::Communicator& comm, const Ints& row);

  std::int64_t node_count() const { return owners_.total(); }
  /// With row numbers. Throws std::logic_error before renumber().
  const MappedFronts& get_fronts() const;

 private:
  comm::IndexPartition owners_;
  MappedFronts fronts_;
  Ints rank_;  // (own nodes) eliminating rank; until the rows are numbered
  bool is_numbered_ = false;
};

}  // namespace carillon::ldlt
