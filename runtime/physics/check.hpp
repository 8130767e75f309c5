// Checks of a world's description.
#pragma once

#include <string>

#include "runtime/physics/world.hpp"

namespace carillon::physics {

/// Throws InputError for the first fault in numbers, masses and inertias, joints (loops, axes) or cords (lengths).
void check(const WorldSpec& spec, const WorldOptions& options);

/// The same for the numbers of one body.
void check_body(const BodySpec& body);

/// Throws InputError for a pose or velocities out of range.
void check_entry(const BodySpec& body);

/// "scene.json:12: the joint between 'a' and 'b'". `what`: "joint" or "cord"; `body` and `to`: -1 is the world.
std::string describe(const WorldSpec& spec, const std::string& place, const char* what, int body, int to);

}  // namespace carillon::physics
