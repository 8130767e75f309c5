// Where a body is struck so that it sounds, and how loud its modes are there.
#pragma once

#include <cstddef>
#include <vector>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

/// Vertices of the bank: the first where a blow along the normal is heard most, the others as far from those before as they can be while
/// they are heard, too. At most `count`; none for a bank without vertices. O(vertices x modes).
std::vector<std::size_t> find_strikes(const Bank& bank, std::size_t count);

/// A-weighted amplitudes of the modes after a blow of 1 N s along the normal at a vertex, (m) [Pa at 1 m], by the bank's own gains.
std::vector<double> calc_blow_levels(const Bank& bank, std::size_t vertex);

}  // namespace carillon::bank
