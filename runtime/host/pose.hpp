// Where a body is between the poses of a simulation.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "runtime/contact/events.hpp"

namespace carillon::host {

/// x_world = R(q) x_body + p.
Vec3 calc_world_point(const contact::Pose& pose, const Vec3& body_m);

/// The pose at a time, between its neighbours: position on a straight line, rotation along the shorter way, renormalised.
/// `poses` in order of time, not empty; before the first and after the last the body rests.
contact::Pose find_pose(std::span<const contact::Pose> poses, double time_s);

}  // namespace carillon::host
