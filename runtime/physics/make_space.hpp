// Bodies, joints and cords of a world's description as those of the rigid-body simulation.
#pragma once

#include "runtime/physics/rigid/space.hpp"
#include "runtime/physics/world.hpp"

namespace carillon::physics {

/// Checks the description (InputError) and makes its bodies.
rigid::Space make_space(const WorldSpec& spec, const WorldOptions& options);
/// Checks that the start velocities are compatible with the joints (InputError).
void check_start(const WorldSpec& spec, const rigid::Space& space);
/// Pose and velocities of a body, to be checked before: check_entry().
rigid::State make_state(const BodySpec& body, const rigid::Solid& solid);

}  // namespace carillon::physics
