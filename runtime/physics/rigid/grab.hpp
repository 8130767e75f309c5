// Bodies held by a damped spring, as by a hand.
#pragma once

#include "runtime/physics/joints/mechanism.hpp"
#include "runtime/physics/rigid/bodies.hpp"

namespace carillon::rigid {

/// Impulse of a grab on its body in a step of this length from now, about the centre of mass [N s, N m s]. Stable for any stiffness,
/// damping and step: the spring acts at the end of the step, by the mobility of the body alone.
joints::Spatial calc_grab_impulse(const Bodies& bodies, const Grab& grab, double step_s);
/// Upper bound of the acceleration of any point of a free body by a force up to `force_n` on any of its points [m/s^2].
double calc_pull(const Solid& solid, double force_n);

}  // namespace carillon::rigid
