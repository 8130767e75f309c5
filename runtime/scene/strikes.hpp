// Strikes of a scene file as events on triangles of the banks.
#pragma once

#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/events/events.hpp"
#include "runtime/scene/mallets.hpp"
#include "runtime/scene/scene.hpp"

namespace carillon::scene {

/// Events of the strikes of a scene.
struct Strikes {
  std::vector<events::Event> events;  // in order of time: one Impulse per strike, several Forces per mallet
  std::vector<Blow> blows;            // mallets, body by body
  std::vector<std::string> warnings;  // suspicious values
};

/// banks[i] belongs to scene.bodies[i]. Throws InputError "file:line: ..." for an unknown triangle, a point further from the surface than a
/// quarter of the body's extent (diagonal of its box; probably a mistake of units), and a mallet that moves away from the surface.
Strikes make_strikes(const Scene& scene, const std::vector<const bank::Bank*>& banks);

}  // namespace carillon::scene
