// Cords and stops of joints as contacts.
#pragma once

#include "runtime/physics/rigid/links.hpp"
#include "runtime/physics/rigid/step.hpp"

namespace carillon::rigid {

/// Length until a cord is taut, or remaining travel of a stop, for the given states [m].
double calc_cord_gap(const Cord& cord, const State& a, const State& b);
/// Updates the contact of a cord's pair from the current states.
void update_cord(const Bodies& bodies, const Cord& cord, Pair& pair);
/// Row of a cord or stop in a step.
Point make_cord_point(const Bodies& bodies, const Step& step, const Cord& cord, const Contact& contact);

}  // namespace carillon::rigid
