// Levels of the modes of a struck body.
#pragma once

#include <cstddef>
#include <vector>

#include "jobs/front/hear/hear.hpp"
#include "runtime/bank/bank.hpp"

namespace carillon::hear {

/// The first `count` modes excited by an impulse at a vertex. `heard`: of mounting::mount().
std::vector<StruckMode> list_modes(const bank::Bank& bank, const std::vector<bank::HeardMode>& heard, std::size_t vertex,
                                   std::size_t count);

}  // namespace carillon::hear
