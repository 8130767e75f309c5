// The few touches that stand for many, and their names.
#pragma once

#include "runtime/physics/geometry/touch.hpp"

namespace carillon::geometry {

/// Touches of one patch (nearer than `patch_m` to one another, normals within 15 degrees) are reduced to four: the deepest and those that
/// span the largest area.
void reduce(std::vector<Touch>& touches, double patch_m);
/// Touches that travel get the name of the one they were at the last call; memory.last becomes `touches`.
void name(std::vector<Touch>& touches, double reach_m, PairMemory& memory);

}  // namespace carillon::geometry
