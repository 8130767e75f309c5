// The rigid-body world: bodies that fall and shelves that stand, out of which comes what they do to each other.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "runtime/bank/bank.hpp"
#include "runtime/contact/events.hpp"

namespace carillon::contact {

/// One body. Its surface, rigid-body data and material come from its bank; `initial` places the frame of the bank's mesh in the world.
struct BodySpec {
  std::string name;                  // for messages
  const bank::Bank* bank = nullptr;  // not owned; must outlive simulate()
  bool fixed = false;                // a shelf: does not move, yet is struck and sounds
  Pose initial;                      // time_s is not used; the quaternion is normalised here
  Vec3 velocity_m_s{};               // of the centre of mass, in the world
  Vec3 angular_velocity_rad_s{};     // in the world
  double restitution = 0.5;          // 0..1; a contact of two bodies takes the geometric mean of theirs
  double friction = 0.4;             // Coulomb, >= 0; a contact of two bodies takes the geometric mean of theirs
};

/// The floor: the half space z <= height_m. It is hard ground and makes no sound of its own. Its `body` index in impulses is -1.
struct GroundSpec {
  double height_m = 0.0;
  double young_modulus_pa = 30e9;  // concrete
  double poisson_ratio = 0.2;
  double restitution = 0.5;
  double friction = 0.5;
};

struct WorldSpec {
  std::vector<BodySpec> bodies;
  std::optional<GroundSpec> ground;
  Vec3 gravity_m_s2{0.0, 0.0, -9.81};
};

/// Lets the world run from 0 to `duration_s` and returns every contact pulse and the path of every body.
/// Two calls with the same spec give the same bits. `progress` (may be empty) is called now and then with the finished fraction, 0..1.
/// Throws InputError for a spec that cannot be simulated (the message names the body: missing bank, bad number, a surface that is open or
/// not a manifold, bodies that start inside each other), SolveError when the integration breaks down.
Simulation simulate(const WorldSpec& spec, double duration_s, const std::function<void(double fraction)>& progress = {});

}  // namespace carillon::contact
