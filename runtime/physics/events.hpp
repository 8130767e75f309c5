// Interface types of the rigid-body simulation: options, cost, and the result of a whole run.
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
  Vec3 position_m{};                          // origin of the mesh frame
  events::Quaternion rotation{1.0, 0, 0, 0};  // unit quaternion w x y z
};

/// Simulation options.
struct WorldOptions {
  double contact_step_s = 2.5e-4;  // maximum step [s] of bodies near contact; flight and the instants of impacts do not depend on it
  double joint_tolerance = 1e-8;   // per integration step of a mechanism's free motion [rad, m]
  double end_s = std::numeric_limits<double>::infinity();  // end of the simulation
  bool islands = true;                                     // false: all bodies in one problem, for comparison
  bool modes = true;                                       // false: impacts ignore modes, as if banks had none
  bool masks_hits = false;                                 // omits hits masked by earlier ones: Masks (pulses.hpp)
  bool lasting_contacts = true;                            // false: no events::LastingContact records, at no cost
  bool audits_energy = false;                              // Statistics::energy and contacts
};

/// Balance of mechanical energy, kinetic and gravitational. Evaluated every 2 ms.
struct EnergyAudit {
  double rise_j = 0.0;      // maximum rise above an earlier moment, with losses by hits added back
  double hit_rise_j = 0.0;  // maximum energy added by a hit; 0 expected
  double kinetic_j = 0.0;   // maximum so far
  double weight_n = 0.0;    // of all moving bodies; rise_j over it is a height
  // Current values; start = motion + modes + lost - lifted - given + error. Radiated energy is taken from the modes by the player, and is
  // in `lost`.
  double start_j = 0.0;      // total at the start; gravity relative to the origin
  double motion_j = 0.0;     // kinetic and gravitational
  double modes_j = 0.0;      // in the modes
  double max_modes_j = 0.0;  // maximum so far
  double modes_share = 0.0;  // maximum of modes over the energy lost by the motion until then; above 1 modes hold more than was lost
  double lost_j = 0.0;       // by friction, in contacts, by modal damping
  double lifted_j = 0.0;     // given to bodies that were moved apart, beyond the share paid by their motion
  double given_j = 0.0;      // from outside, by pushes, grabs, and bodies added or removed
  double error_j = 0.0;      // maximum so far
};

/// Penetration of one body in another, or in the ground (-1).
struct Depth {
  int body = -1, other = -1;
  double depth_m = 0.0;
  double unexplained_m = 0.0;  // beyond the depth explained or left by a modal impact
  double thickness_m = 0.0;    // of the thinner body
  double time_s = 0.0;

  /// The unexplained part over the permitted depth: 0.1 mm, at most 5 % of the thickness.
  double calc_excess() const { return unexplained_m > 0.0 ? unexplained_m / std::min(1e-4, 0.05 * thickness_m) : 0.0; }
};

/// Hit rate of two bodies, or of one on the ground (-1); none: per_s is 0.
struct HitRate {
  int body = -1, other = -1;
  double per_s = 0.0, time_s = 0.0;
};

/// Audit of the contacts. Depth in the ground is measured at every step, between bodies every 2 ms.
struct ContactAudit {
  Depth now, deepest;              // maximum depth: current, and so far
  Depth unexplained;               // maximum calc_excess() so far
  double hits_per_s = 0.0;         // in the last second
  HitRate worst_pair;              // in the last second
  HitRate busiest;                 // maximum over all half seconds
  std::int64_t pushes = 0;         // displacements of bodies with deep penetrations
  std::int64_t ended_impacts = 0;  // modal impacts ended before their contacts separated
  double longest_impact_s = 0.0;   // of modal impacts
};

/// Cost of a world so far.
struct Statistics {
  std::int64_t steps = 0;       // small steps of bodies near contact, and windows with free flight only
  std::int64_t body_steps = 0;  // moved bodies, summed over the steps
  std::int64_t islands = 0;     // current groups of bodies that may touch each other
  std::int64_t searches = 0;    // for touches of a pair
  std::int64_t impacts = 0;
  std::int64_t sweeps = 0;      // over the contacts of a group
  std::int64_t mechanisms = 0;  // groups of bodies on joints
  std::int64_t flights = 0;     // integrations of their free motion
  EnergyAudit energy;           // zeros unless requested
  ContactAudit contacts;        // zeros unless requested
};

/// A finished simulation: impulses in time order; per body, poses in time order (at least at 0 and at the end).
struct Simulation {
  std::vector<Impulse> impulses;
  std::vector<std::vector<Pose>> poses;
  std::int64_t steps = 0;
};

}  // namespace carillon::physics
