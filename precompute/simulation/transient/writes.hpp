// Write positions of element forces, so that each node's sum has one order on any number of ranks. Internal header of carillon::transient.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/simulation/transient/quad.hpp"

namespace carillon::transient {

/// Elements of one rank: all that touch an own node, in ascending order. Own nodes have indices 0 .. own_nodes - 1, halo nodes follow. Any
/// kind of element: solids, sheet triangles, edge stencils.
struct ElementNodes {
  std::vector<std::int64_t> begin{0};  // (e + 1) into nodes
  std::vector<std::int32_t> nodes;     // indices

  void add(const std::int32_t* places, std::size_t count) {
    nodes.insert(nodes.end(), places, places + count);
    begin.push_back(static_cast<std::int64_t>(nodes.size()));
  }
  std::size_t count() const { return begin.size() - 1; }
};

/// Elements with halo nodes ("outer") are computed last, after communication. Own nodes that share an element with a halo node get a slot
/// per contribution, summed at the end in ascending element order. Other own nodes are touched by inner elements only, which add to them in
/// ascending order directly. Forces on halo nodes go to an unread entry. One rank: no outer elements, no slots.
struct WritePlan {
  std::vector<std::int32_t> writes;        // as ElementNodes::nodes: force entries
  std::vector<std::int32_t> inner, outer;  // elements, ascending
  std::vector<std::int32_t> summed;        // own nodes with slots
  std::vector<std::int32_t> slot_begin;    // (summed + 1): slots, contiguous from first_slot
  std::int32_t last_slot = 0;              // one past the end

  /// f[node] += its slots, in order.
  void gather(Quad* f) const;
};

/// Slots begin at `first_slot`; `no_entry` is not read. Local.
WritePlan plan_writes(const ElementNodes& elements, std::int32_t own_nodes, std::int32_t first_slot, std::int32_t no_entry);

}  // namespace carillon::transient
