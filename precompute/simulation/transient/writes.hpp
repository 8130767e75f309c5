// Where elements add their forces, so that each node's sum has one order on any number of ranks. Inner header of carillon::transient.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/simulation/transient/quad.hpp"

namespace carillon::transient {

/// Elements of one rank: all that touch a node of its own, in ascending order. Own nodes have the places 0 .. own_nodes - 1, halo nodes
/// those behind. Any kind of element: solids, triangles of sheets, stencils of edges.
struct ElementNodes {
  std::vector<std::int64_t> begin{0};  // (e + 1) into nodes
  std::vector<std::int32_t> nodes;     // places

  void add(const std::int32_t* places, std::size_t count) {
    nodes.insert(nodes.end(), places, places + count);
    begin.push_back(static_cast<std::int64_t>(nodes.size()));
  }
  std::size_t count() const { return begin.size() - 1; }
};

/// The plan: elements with halo nodes ("outer") are computed last, when the halo has come. Own nodes that share an element with a halo node
/// get every contribution in a slot of its own, and the sum over the slots in ascending order of the elements at the end. Other own nodes
/// are touched by elements without halo nodes only, which add to them in ascending order as they are computed. Halo nodes' forces go to an
/// entry that is not read. One rank: no outer elements, no slots.
struct WritePlan {
  std::vector<std::int32_t> writes;        // as ElementNodes::nodes: entries of the array of forces
  std::vector<std::int32_t> inner, outer;  // elements, ascending
  std::vector<std::int32_t> summed;        // own nodes with slots
  std::vector<std::int32_t> slot_begin;    // (summed + 1): slots, which follow each other from first_slot
  std::int32_t last_slot = 0;              // one behind

  /// f[node] += its slots, in their order.
  void gather(Quad* f) const;
};

/// Slots begin at `first_slot`; `no_entry` is not read. Local.
WritePlan plan_writes(const ElementNodes& elements, std::int32_t own_nodes, std::int32_t first_slot, std::int32_t no_entry);

}  // namespace carillon::transient
