// Mallet blows: contact of a head of given mass, speed and stiffness with a ringing body.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/drive/mode_sets.hpp"
#include "runtime/events/events.hpp"
#include "runtime/physics/impact/impact.hpp"
#include "runtime/scene/scene.hpp"

namespace carillon::scene {

/// Result of one blow. Energies in J: before = after + motion + modes + lost, summed over simultaneous blows.
struct Blow {
  std::string body;
  double time_s = 0.0;     // first contact
  double contact_s = 0.0;  // from the first force to the last
  double impulse_n_s = 0.0, peak_n = 0.0;
  double restitution = 0.0;              // rebound speed of the head (as a rigid body) over its initial speed
  double before_j = 0.0, after_j = 0.0;  // of the head
  int together = 1;  // number of overlapping blows on the body; the following fields are totals, given for the first of them
  double motion_j = 0.0, modes_j = 0.0;  // to the rigid motion, and to the modes by the end of the blow
  double lost_j = 0.0;                   // in the head, by friction, by damping, above the bank's band
};

/// Plays mallets on bodies. A body keeps ringing between blows, so later blows meet it in motion; overlapping blows on one body are solved
/// together.
class Mallets {
 public:
  /// A strike with its place in the frame of the mesh; `velocity_m_s` of the head.
  struct Strike {
    const SceneStrike* from = nullptr;
    std::size_t body = 0;
    std::int32_t triangle = 0;
    Vec3 barycentric{};
    Vec3 velocity_m_s{};
  };

  /// Strikes on one body, in any order. `bank` is the body's and outlives this. Appends the forces and results in order of time. Throws
  /// InputError "file:line: ..." if the head does not move towards the surface.
  void play(const SceneBody& body, const bank::Bank& bank, std::vector<Strike> strikes, std::vector<events::Event>& events,
            std::vector<Blow>& blows, std::vector<std::string>& warnings);

 private:
  drive::ModeSets modes_;
};

}  // namespace carillon::scene
