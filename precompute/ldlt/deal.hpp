// Which rank has which front, and what each has to know of them.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/ldlt/elimination.hpp"
#include "precompute/ldlt/mapping.hpp"

namespace carillon::ldlt {

/// The mapping of all fronts, as every rank makes it.
struct SharedMapping {
  Ints ids;  // of the fronts mapped, ascending
  std::vector<FrontCost> costs;
  Mapping mapping{{}, 1, 1};
  Ints order;  // (ids) place among the shared fronts, -1: one rank has it

  std::int32_t find(std::int32_t id) const {
    const auto at = std::lower_bound(ids.begin(), ids.end(), id);
    return at != ids.end() && *at == id ? static_cast<std::int32_t>(at - ids.begin()) : -1;
  }
};

/// All fronts as the ranks that hold them know them, and who has which.
struct MappedFronts {
  Elimination elimination;
  SharedMapping shared;
  std::vector<Ints> owners;  // (parts) of (supernodes): who has each, -1: it is shared
};

/// Maps the fronts. Collective.
MappedFronts map_fronts(const comm::Communicator& comm, Elimination elimination);

/// A front on its way from the holder to those that have it or share it or its parent. Positions of the whole order.
struct DealtFront {
  std::int32_t id = 0;
  std::int32_t parent = -1;
  std::int32_t owner = -1;  // -1: shared
  std::int32_t first = 0;
  Ints nodes;  // (width) global numbers of the pivots
  Ints rows;

  std::int32_t width() const { return static_cast<std::int32_t>(nodes.size()); }
};

/// Sends each front to the rank that has it, or to those that share it, and the children of shared fronts to all ranks of those. Result:
/// ascending ids. Collective.
std::vector<DealtFront> deal_fronts(const comm::Communicator& comm, const MappedFronts& fronts);

}  // namespace carillon::ldlt
