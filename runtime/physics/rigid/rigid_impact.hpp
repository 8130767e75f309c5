// Impacts of rigid bodies: all points of one instant at once.
#pragma once

#include <vector>

#include "runtime/physics/rigid/links.hpp"
#include "runtime/physics/rigid/step.hpp"
#include "runtime/physics/rigid/touch_sets.hpp"

namespace carillon::rigid {

/// An impact of bodies of a step: contacts, hits and points, one for one, and the bodies as they are before or, solved, after it.
struct Collision {
  std::vector<ContactRef> contacts;
  std::vector<Hit> hits;
  std::vector<Point> points;
  std::vector<Mover> movers;      // the bodies of the step
  std::vector<Linkage> linkages;  // of its articulations, as they are now

  Collision() = default;
  Collision(Collision&&) = default;  // movers refer to linkages
  Collision& operator=(Collision&&) = default;
};

/// Newton's restitution and Coulomb's cone for all points of an impact. Invariant: an impact takes energy from the motion, or none, and
/// changes no momentum of a free island. It keeps nothing between calls.
class RigidImpact {
 public:
  RigidImpact(Bodies& bodies, const TouchSets& touches) : bodies_(bodies), touches_(touches) {}

  /// The points that strike now, and those in touch with the bodies that they move, three bodies far; in order.
  std::vector<ContactRef> gather(const Step& step, const std::vector<ContactRef>& first) const;
  /// Hits with the restitution of rigid bodies, and points with the velocities that they are to have.
  Collision make(const Step& step, std::vector<ContactRef> contacts) const;
  /// The impulses of all hits.
  void solve(Collision& collision);
  /// Gives the bodies these impulses; the contacts touch or rebound after that. Returns the record of it, and the loss of the motion [J].
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
