// Clearance of points from rigid obstacles.
#pragma once

#include "precompute/job/obstacles.hpp"
#include "runtime/base/vector.hpp"

namespace carillon::transient {

using job::RigidObstacle;

/// Of a point: signed distance [m], positive outside, and unit normal towards the free side.
struct Clearance {
  double distance_m = 0;
  Vec3 normal{};
};

Clearance find_clearance(const RigidObstacle& obstacle, const Vec3& p);

}  // namespace carillon::transient
