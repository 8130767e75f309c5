// What the rigid-body simulation is asked and what it gives back: options, cost, and a whole run in one piece.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "runtime/events/events.hpp"

namespace carillon::physics {

using events::Impulse;

/// A rigid pose: x_world = R(q) x_body + p.
struct Pose {
  double time_s = 0.0;
  Vec3 position_m{};                          // of the origin of the mesh frame
  events::Quaternion rotation{1.0, 0, 0, 0};  // unit quaternion w x y z
};

/// How a world is run.
struct WorldOptions {
  double contact_step_s =
      2.5e-4;  // the longest step [s] of bodies that touch or may. Flight and the instant of an impact do not depend on it
  double joint_tolerance = 1e-8;                           // of a step of a mechanism's free motion [rad, m]
  double end_s = std::numeric_limits<double>::infinity();  // the world stops there
  bool islands = true;                                     // false: all bodies in one problem, for comparison
  bool modes = true;                                       // false: impacts do not look at modes, as if banks had none
  bool masks_hits = false;                                 // hits that are not heard after others are left out: Masks (pulses.hpp)
  bool lasting_contacts = true;                            // false: no events::LastingContact records, and none of their cost
  bool audits_energy = false;                              // Statistics::energy and contacts
};

/// The books of mechanical energy: kinetic and of gravity. Looked at every 2 ms.
struct EnergyAudit {
  double rise_j = 0.0;      // the most that it has ever been above an earlier moment, what hits took put back
  double hit_rise_j = 0.0;  // the most that a hit has added; they only take
  double kinetic_j = 0.0;   // the largest there has been
  double weight_n = 0.0;    // of all bodies that move; rise_j over it is a height
  // Now; start = motion + modes + lost - lifted + error. Radiated energy is taken from the modes by the player, and is in `lost`.
  double start_j = 0.0;      // all there was at the beginning; gravity counts from the origin
  double motion_j = 0.0;     // kinetic and of gravity
  double modes_j = 0.0;      // in the modes
  double max_modes_j = 0.0;  // the largest there has been
  double modes_share = 0.0;  // the largest there has been, of what the motion had lost by then; above 1 modes have more than was lost
  double lost_j = 0.0;       // by friction, in contacts, in the modes' damping
  double lifted_j = 0.0;     // given to bodies that were moved apart, beyond the payment of their motion
  double error_j = 0.0;      // the largest there has been
};

/// Of one body in another, or in the ground (-1).
struct Depth {
  int body = -1, other = -1;
  double depth_m = 0.0;
  double unexplained_m = 0.0;  // beyond the depth explained or left by an impact with modes
  double thickness_m = 0.0;    // of the thinner one
  double time_s = 0.0;

  /// The unexplained part over the depth that is right: 0.1 mm, and no more than 5 % of the thickness.
  double calc_excess() const { return unexplained_m > 0.0 ? unexplained_m / std::min(1e-4, 0.05 * thickness_m) : 0.0; }
};

/// Hits of two bodies, or of one on the ground (-1); none: per_s is 0.
struct HitRate {
  int body = -1, other = -1;
  double per_s = 0.0, time_s = 0.0;
};

/// Checks of the contacts. Depth in the ground is measured at every step, between bodies every 2 ms.
struct ContactAudit {
  Depth now, deepest;              // the largest depth now, and there has been
  Depth unexplained;               // of most calc_excess() there has been
  double hits_per_s = 0.0;         // in the last second
  HitRate worst_pair;              // in the last second
  HitRate busiest;                 // of all half seconds
  std::int64_t pushes = 0;         // displacements of bodies that were too deep
  std::int64_t ended_impacts = 0;  // with modes, that were ended before their contacts had parted
  double longest_impact_s = 0.0;   // with modes
};

/// What a world has cost so far.
struct Statistics {
  std::int64_t steps = 0;       // small steps of what touches or may, and windows in which bodies only fly
  std::int64_t body_steps = 0;  // of each, the bodies that moved in it, summed
  std::int64_t islands = 0;     // groups of bodies that may touch each other at present
  std::int64_t searches = 0;    // for the touches of a pair
  std::int64_t impacts = 0;
  std::int64_t sweeps = 0;      // over the contacts of a group
  std::int64_t mechanisms = 0;  // groups of bodies on joints
  std::int64_t flights = 0;     // integrations of their free motion
  EnergyAudit energy;           // zeros unless asked for
  ContactAudit contacts;        // likewise
};

/// A finished simulation: impulses in order of time; per body, poses in order of time (at least at 0 and at the end).
struct Simulation {
  std::vector<Impulse> impulses;
  std::vector<std::vector<Pose>> poses;
  std::int64_t steps = 0;
};

}  // namespace carillon::physics
