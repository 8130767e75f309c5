// The same number of elements on every rank, where the order of elimination has given them unequal numbers.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/comm/communicator.hpp"

namespace carillon::mesh {

/// Elements that go from a rank with too many to one with too few.
struct Transfer {
  int from = 0;
  int to = 0;
  std::int64_t end = 0;  // of the elements of `from` that have gone with this transfer and those before it
};

/// Transfers after which no rank has more than one element more than another, by the rank that gives; the ranks that get them ascend.
std::vector<Transfer> plan_transfers(std::vector<std::int64_t> counts);

/// Changes the ranks of this rank's elements so that all ranks have nearly the same number: those that go are the first of their rank by
/// position, and elements with the same position go together. rank, position: (e). Collective.
void level_elements(const comm::Communicator& comm, std::vector<std::int32_t>& rank, const std::vector<std::int32_t>& position);

}  // namespace carillon::mesh
