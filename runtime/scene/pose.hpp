// Interpolation of poses.
#pragma once

#include <span>

#include "runtime/physics/events.hpp"

namespace carillon::scene {

/// x_world = R(q) x_body + p.
Vec3 calc_world_point(const physics::Pose& pose, const Vec3& body_m);

/// Pose at a time: linear position, rotation along the shorter arc, renormalised. `poses` is in order of time and not empty; the body rests
/// before the first and after the last.
physics::Pose find_pose(std::span<const physics::Pose> poses, double time_s);

}  // namespace carillon::scene
