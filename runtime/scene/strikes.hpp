// The blows of a scene file as events on triangles of the banks.
#pragma once

#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/events/events.hpp"
#include "runtime/scene/mallets.hpp"
#include "runtime/scene/scene.hpp"

namespace carillon::scene {

/// What the strikes of a scene come to.
struct Strikes {
  std::vector<events::Event> events;  // in order of time: an Impulse a strike, some Forces a mallet
  std::vector<Blow> blows;            // of mallets, body by body
  std::vector<std::string> warnings;  // of strikes that may not be meant
};

/// banks[i] belongs to scene.bodies[i].
/// Throws InputError "file:line: ..." for a triangle that the bank does not have, and for a point further from the surface than a quarter
/// of the body's extent (the diagonal of its box): it is likelier a mistake of units than a blow; for a mallet that flies away.
Strikes make_strikes(const Scene& scene, const std::vector<const bank::Bank*>& banks);

}  // namespace carillon::scene
