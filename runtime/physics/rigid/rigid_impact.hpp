// Impacts of rigid bodies: all points of one instant simultaneously.
#pragma once

#include <vector>

#include "runtime/physics/rigid/links.hpp"
#include "runtime/physics/rigid/step.hpp"
#include "runtime/physics/rigid/touch_sets.hpp"

namespace carillon::rigid {

/// Impact of bodies of a step: contacts, hits and points (same indices), and the bodies before or, once solved, after it.
struct Collision {
  std::vector<ContactRef> contacts;
  std::vector<Hit> hits;
  std::vector<Point> points;
  std::vector<Mover> movers;      // bodies of the step
  std::vector<Linkage> linkages;  // of its articulations, current configuration

  Collision() = default;
  Collision(Collision&&) = default;  // movers refer to linkages
  Collision& operator=(Collision&&) = default;
};

/// Newton's restitution and Coulomb's cone for all points of an impact. Invariant: an impact never adds energy to the motion, and conserves
/// the momentum of a free island. Stateless between calls.
class RigidImpact {
 public:
  RigidImpact(Bodies& bodies, const TouchSets& touches) : bodies_(bodies), touches_(touches) {}

  /// Striking points, and contacts of the bodies that they move, up to three bodies away; sorted.
  std::vector<ContactRef> gather(const Step& step, const std::vector<ContactRef>& first) const;
  /// Hits with the restitution of rigid bodies, and points with their wanted velocities.
  Collision make(const Step& step, std::vector<ContactRef> contacts) const;
  /// Computes the impulses of all hits.
  void solve(Collision& collision);
  /// Applies the impulses to the bodies; the contacts then touch or rebound. Returns the record, and the energy lost by the motion [J].
  Strike apply(Collision& collision, double& lost_j);

 private:
  bool is_row(const Collision& collision) const;
  void solve_row(Collision& collision) const;
  Hit make_hit(const Collision& collision, const Contact& contact, Point& point) const;

  Bodies& bodies_;
  const TouchSets& touches_;
  Solver solver_;
};

}  // namespace carillon::rigid
