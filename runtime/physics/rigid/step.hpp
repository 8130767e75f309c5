// One small step of an island: the values that its stages pass on.
#pragma once

#include <vector>

#include "runtime/physics/rigid/bodies.hpp"
#include "runtime/physics/rigid/contact.hpp"
#include "runtime/physics/rigid/linkage.hpp"
#include "runtime/physics/rigid/solver.hpp"

namespace carillon::rigid {

/// Bodies that move and may touch each other in a step, and their pairs.
struct Island {
  std::vector<int> bodies;
  std::vector<Pair*> pairs;
  int stride = 1;  // small steps of the window that it takes at once
};

/// A body at the end of a step without contacts.
struct FreeMotion {
  State state;
  Placed placed;
  int articulation = -1;  // of the step's; -1: on no joint
};

/// An articulation in a step.
struct ArticulationStep {
  Articulation* articulation = nullptr;
  joints::Coordinates free;  // at the end without contacts
  std::vector<double> push;  // change of its velocities by the contacts; empty: none
  Linkage linkage;           // at `free`
};

/// A step of one island. StepProblem::predict() writes movers, predictions and loads, make_points() points and rows, solve() velocities and
/// impulses; Instants, RigidImpact and ModalImpacts read them. Invariant: between begin() and end() every body of the island has its index
/// in island().bodies, and no other body has one.
class Step {
 public:
  explicit Step(const Bodies& bodies) : bodies_(bodies), index_(bodies.count(), -1) {}

  void begin(Island& island);
  void end();
  /// A body that has been woken.
  void add(int body);

  Island& island() const { return *island_; }
  int count() const { return static_cast<int>(island_->bodies.size()); }
  int body(int n) const { return island_->bodies[n]; }
  /// -1: is not in the island, or does not move.
  int find(int body) const { return bodies_.moves(body) ? index_[body] : -1; }
  /// Is it in the island, or does it not move?
  bool has(int body) const { return !bodies_.moves(body) || index_[body] >= 0; }
  /// A touch of another island's body that was found in this step waits for the next.
  bool has(const Pair& pair) const { return has(pair.a) && has(pair.b); }

  double length_s = 0.0;    // of the part that is predicted
  double together_s = 0.0;  // touches nearer in time than this are one impact
  std::vector<Mover> movers;
  std::vector<FreeMotion> free;
  std::vector<ArticulationStep> articulations;
  std::vector<joints::Spatial> loads;  // impulses of sleeping bodies on these
  std::vector<Point> points;
  std::vector<ContactRef> rows;  // of the points
  std::vector<Vec3> turned;      // angular impulses on the bodies

  /// The nth body a part of the step later: the impulses of the contacts act all along.
  State calc_moved(int n, double part_s) const;
  joints::Coordinates calc_moved(const ArticulationStep& articulation, double part_s) const;
  /// Energy that a point took from the motion in the first part of the step [J]: its impulses times the means of the velocities before and
  /// after.
  double calc_loss(const Point& point, double part) const;
  /// Work of the loads on the nth body on its way through a part of the step, at whose end it is at `to` [J].
  double calc_load_work(int n, const State& to, double part_s) const;

 private:
  const Bodies& bodies_;
  Island* island_ = nullptr;
  std::vector<int> index_;
};

/// A contact as it is now, between bodies of the step.
Point make_point(const Bodies& bodies, const Step& step, const Contact& contact);

/// Adds a force at a contact as the body of a, or of b, feels it.
void add_pull(const Bodies& bodies, const Contact& contact, bool is_a, const Vec3& force_n, joints::Spatial& pull);

}  // namespace carillon::rigid
