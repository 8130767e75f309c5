// Cords and stops of joints as contacts.
#pragma once

#include "runtime/physics/rigid/links.hpp"
#include "runtime/physics/rigid/step.hpp"

namespace carillon::rigid {

/// Length that a cord lacks to be taut, or the way that is left to a stop, its bodies being there [m].
double calc_cord_gap(const Cord& cord, const State& a, const State& b);
/// The contact of a cord's pair as it is now.
void update_cord(const Bodies& bodies, const Cord& cord, Pair& pair);
/// The row of a cord or a stop in a step.
Point make_cord_point(const Bodies& bodies, const Step& step, const Cord& cord, const Contact& contact);

}  // namespace carillon::rigid
