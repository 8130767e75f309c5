// Where a body is between the poses of a simulation.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "runtime/physics/events.hpp"

namespace carillon::scene {

/// x_world = R(q) x_body + p.
Vec3 calc_world_point(const physics::Pose& pose, const Vec3& body_m);

/// The pose at a time, between its neighbours: position on a straight line, rotation along the shorter way, renormalised.
/// `poses` in order of time, not empty; before the first and after the last the body rests.
physics::Pose find_pose(std::span<const physics::Pose> poses, double time_s);

}  // namespace carillon::scene
