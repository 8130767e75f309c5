// What ranks do alone, made even.
#pragma once

#include <vector>

#include "precompute/ldlt/mapping.hpp"

namespace carillon::ldlt {

/// Gives subtrees below shared fronts to other ranks that share the same front, exchanges two, and shares the root of a subtree that is too
/// large for that, until the ranks have about the same to do alone: a shared front begins when the slowest of them is done. fronts: those
/// that the mapping was made of. Shares that set_shares() gave are not looked at.
void level_subtrees(const std::vector<FrontCost>& fronts, Mapping& mapping);

}  // namespace carillon::ldlt
