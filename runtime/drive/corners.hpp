// Corners of flat faces that land together. Internal to this folder.
#pragma once

#include <array>
#include <vector>

#include "runtime/drive/touch_bodies.hpp"
#include "runtime/drive/touch_spots.hpp"

namespace carillon::drive {

/// A corner of one body over a surface of the other.
struct Corner {
  std::array<Vec3, 2> stations_m{};  // on a and b, mesh frames; of the ground in the world
  double gap_m = 0.0;                // when the first corner touches
};

/// Corners that are nearer than `reach_m` to the surface at a hit when the first of them touches: engines may stop a face that lands by two
/// of its corners. Ground and fixed bodies without a surface are planes.
std::vector<Corner> find_corners(const StepView& step, const FinishedHit& hit, double reach_m);

}  // namespace carillon::drive
