// Load balance of the subtrees that ranks eliminate alone.
#pragma once

#include <vector>

#include "precompute/ldlt/mapping.hpp"

namespace carillon::ldlt {

/// Moves subtrees below shared fronts to other ranks that share the same front, exchanges two, and shares the root of a subtree that is too
/// large for that, until the ranks have about the same work to do alone: a shared front starts when the slowest of its ranks is ready.
/// fronts: those used to construct the mapping. Ignores shares set by set_shares().
void level_subtrees(const std::vector<FrontCost>& fronts, Mapping& mapping);

}  // namespace carillon::ldlt
