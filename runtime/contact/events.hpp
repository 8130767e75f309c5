// What the rigid-body simulation is asked and what it gives back: options, cost, and a whole run in one piece.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "runtime/stream/events.hpp"

namespace carillon::contact {

using stream::Impulse;
using stream::Vec3;

/// A rigid pose: x_world = R(q) x_body + p.
struct Pose {
  double time_s = 0.0;
  Vec3 position_m{};                          // of the origin of the mesh frame
  stream::Quaternion rotation{1.0, 0, 0, 0};  // unit quaternion w x y z
};

/// How a world is run.
struct WorldOptions {
  /// The longest step [s] while something in touch moves faster than 1 cm/s; slower, longer ones in proportion. Steps of bodies that fly
  /// free, and the instant of an impact, do not hang on it.
  double contact_step_s = 5e-4;
  double end_s = std::numeric_limits<double>::infinity();  // the world stops there
  bool islands = true;                                     // false: one Simbody system for all bodies, for comparison
  bool lasting_contacts = true;                            // false: no stream::Contact records, and none of their cost
  bool audits_energy = false;                              // Statistics::energy
};

/// The books of mechanical energy: kinetic, of gravity, and of the springs of resting contacts. Looked at every 2 ms.
struct EnergyAudit {
  double rise_j = 0.0;      // the most that it has ever been above an earlier moment, what hits took put back
  double hit_rise_j = 0.0;  // the most that a hit has added; they only take
  double kinetic_j = 0.0;   // the largest there has been
  double weight_n = 0.0;    // of all bodies that move; rise_j over it is a height
};

/// What a world has cost so far.
struct Statistics {
  std::int64_t steps = 0;       // integrations, those that were thrown away again included
  std::int64_t body_steps = 0;  // of each, the bodies that moved in it, summed
  std::int64_t islands = 0;     // groups of moving bodies at present
  std::int64_t made = 0;        // Simbody systems made so far
  double seconds_cpu = 0.0;
  EnergyAudit energy;  // zeros unless asked for
};

/// A finished simulation: impulses in order of time; per body, poses in order of time (at least at 0 and at the end).
struct Simulation {
  std::vector<Impulse> impulses;
  std::vector<std::vector<Pose>> poses;
  double seconds_cpu = 0.0;
  std::int64_t steps = 0;
};

}  // namespace carillon::contact
