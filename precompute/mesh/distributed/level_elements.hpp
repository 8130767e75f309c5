// Balances the element counts that result from the elimination order.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/comm/communicator.hpp"

namespace carillon::mesh {

/// Elements moved from a rank with too many to one with too few.
struct Transfer {
  int from = 0;
  int to = 0;
  std::int64_t end = 0;  // cumulative count of elements moved away from `from`, including this transfer
};

/// Transfers after which the counts differ by at most one, sorted by sender; receivers ascend.
std::vector<Transfer> plan_transfers(std::vector<std::int64_t> counts);

/// Changes the ranks of this rank's elements so that all ranks have nearly the same number: the first elements of a rank by position move,
/// elements with the same position together. rank, position: (e). Collective.
void level_elements(const comm::Communicator& comm, std::vector<std::int32_t>& rank, const std::vector<std::int32_t>& position);

}  // namespace carillon::mesh
