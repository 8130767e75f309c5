// Reduction of touches to few representatives, and their identities.
#pragma once

#include "runtime/physics/geometry/touch.hpp"

namespace carillon::geometry {

/// Reduces the touches of one patch (closer than `patch_m`, normals within 15 degrees) to at most eight: the deepest, those that span the
/// largest area, and those below the planes of the kept ones.
void reduce(std::vector<Touch>& touches, double patch_m);
/// Moving touches keep the id of the corresponding touch of the previous call; memory.last becomes `touches`.
void name(std::vector<Touch>& touches, double reach_m, PairMemory& memory);

}  // namespace carillon::geometry
