// The blows of a scene file as contact pulses on triangles of the banks.
#pragma once

#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/contact/events.hpp"
#include "runtime/host/scene.hpp"

namespace carillon::host {

/// One impulse for each strike, in the order of the scene. banks[i] belongs to scene.bodies[i].
/// Throws InputError "file:line: ..." for a triangle that the bank does not have, and for a point further from the surface than a quarter
/// of the body's extent (the diagonal of its box): it is likelier a mistake of units than a blow.
std::vector<contact::Impulse> make_impulses(const Scene& scene, const std::vector<const bank::Bank*>& banks);

}  // namespace carillon::host
