// How loud the modes of a body are where it is struck.
#pragma once

#include <cstddef>
#include <vector>

#include "jobs/front/hear/hear.hpp"
#include "runtime/bank/bank.hpp"

namespace carillon::hear {

/// The first `count` modes as a blow at a vertex makes them. `heard`: of mounting::mount().
std::vector<StruckMode> list_modes(const bank::Bank& bank, const std::vector<bank::HeardMode>& heard, std::size_t vertex,
                                   std::size_t count);

}  // namespace carillon::hear
