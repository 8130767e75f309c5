// Where a body is struck so that it sounds, and how loud its modes are there.
#pragma once

#include <cstddef>
#include <vector>

#include "jobs/hear/hear.hpp"
#include "runtime/bank/bank.hpp"

namespace carillon::hear {

/// Vertices of the bank: the first where a blow along the normal is heard most, the others as far from those before as they can be while
/// they are heard, too. At most `count`.
std::vector<std::size_t> find_strikes(const bank::Bank& bank, std::size_t count);

/// The first `count` modes as a blow at a vertex makes them.
std::vector<HeardMode> list_modes(const bank::Bank& bank, std::size_t vertex, std::size_t count);

/// The time after which nearly all of what a blow makes is over: T60 of its loudest modes [s].
double calc_ring_s(const bank::Bank& bank, std::size_t vertex);

}  // namespace carillon::hear
