// Assignment of fronts to ranks.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/ldlt/elimination.hpp"
#include "precompute/ldlt/mapping.hpp"

namespace carillon::ldlt {

/// The mapping of all fronts, identical on every rank.
struct SharedMapping {
  Ints ids;  // of the mapped fronts, ascending
  std::vector<FrontCost> costs;
  Mapping mapping{{}, 1, 1};
  Ints order;  // (ids) position among the shared fronts, -1: front of one rank

  std::int32_t find(std::int32_t id) const {
    const auto at = std::lower_bound(ids.begin(), ids.end(), id);
    return at != ids.end() && *at == id ? static_cast<std::int32_t>(at - ids.begin()) : -1;
  }
};

/// All fronts as known by their holders, and their owners.
struct MappedFronts {
  Elimination elimination;
  SharedMapping shared;
  std::vector<Ints> owners;  // (parts) of (supernodes): owning rank, -1: shared
};

/// Maps the fronts. Collective.
MappedFronts map_fronts(const comm::Communicator& comm, Elimination elimination);

/// A front sent from its holder to the ranks that own or share it or its parent. Positions are in the global elimination order.
struct DealtFront {
  std::int32_t id = 0;
  std::int32_t parent = -1;
  std::int32_t owner = -1;  // -1: shared
  std::int32_t first = 0;
  Ints nodes;  // (width) global numbers of the pivots
  Ints rows;

  std::int32_t width() const { return static_cast<std::int32_t>(nodes.size()); }
};

/// Sends each front to the rank that owns it, or to the ranks that share it, and the children of shared fronts to all ranks of those.
/// Result: ascending ids. Collective.
std::vector<DealtFront> deal_fronts(const comm::Communicator& comm, const MappedFronts& fronts);

}  // namespace carillon::ldlt
