// Blows by mallets: what a head of some mass, speed and hardness does to a body that rings.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/physics/mode_sets.hpp"
#include "runtime/events/events.hpp"
#include "runtime/scene/scene.hpp"
#include "runtime/physics/impact/impact.hpp"

namespace carillon::scene {

/// What came of one blow. Energies in J: before = after + motion + modes + lost, summed over those that were struck together.
struct Blow {
  std::string body;
  double time_s = 0.0;     // of the touch
  double contact_s = 0.0;  // from the first force to the last
  double impulse_n_s = 0.0, peak_n = 0.0;
  double restitution = 0.0;              // speed at which the head leaves the body, as a rigid one, over that at which it came
  double before_j = 0.0, after_j = 0.0;  // of the head
  int together = 1;                      // blows on the body that overlap with it; what follows is of all of them, and of the first alone
  double motion_j = 0.0, modes_j = 0.0;  // given to the body's motion, and to its modes by the end of the blow
  double lost_j = 0.0;                   // in the head, by friction, by damping, above the bank's band
};

/// Plays mallets on bodies. A body keeps ringing from one blow to the next, so a later one meets it as it then moves; what overlaps on one
/// body is solved together.
class Mallets {
 public:
  /// A strike with its place, in the frame of the mesh; `velocity_m_s` of the head.
  struct Strike {
    const SceneStrike* from = nullptr;
    std::size_t body = 0;
    std::int32_t triangle = 0;
    Vec3 barycentric{};
    Vec3 velocity_m_s{};
  };

  /// Strikes on one body, in any order. `bank` is the body's and outlives this. Appends the forces and what came of the blows, in order of
  /// time. Throws InputError "file:line: ..." where the head does not move towards the surface.
  void play(const SceneBody& body, const bank::Bank& bank, std::vector<Strike> strikes, std::vector<events::Event>& events,
            std::vector<Blow>& blows, std::vector<std::string>& warnings);

 private:
  physics::ModeSets modes_;
};

}  // namespace carillon::scene
