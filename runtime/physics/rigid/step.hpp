// One small step of an island: values exchanged by its stages.
#pragma once

#include <vector>

#include "runtime/physics/rigid/bodies.hpp"
#include "runtime/physics/rigid/contact.hpp"
#include "runtime/physics/rigid/linkage.hpp"
#include "runtime/physics/rigid/solver.hpp"

namespace carillon::rigid {

/// Moving bodies that may touch each other in a step, and their pairs.
struct Island {
  std::vector<int> bodies;
  std::vector<Pair*> pairs;
  int stride = 1;  // small steps per step of the island
};

/// A body at the end of a step without contacts.
struct FreeMotion {
  State state;
  Placed placed;
  int articulation = -1;  // index in the step; -1: not on joints
};

/// An articulation in a step.
struct ArticulationStep {
  Articulation* articulation = nullptr;
  joints::Coordinates free;  // at the end without contacts
  std::vector<double> push;  // change of its velocities by contacts; empty: none
  Linkage linkage;           // at `free`
};

/// A step of one island. StepProblem::predict() writes movers, predictions and loads, make_points() points and rows, solve() velocities and
/// impulses; Instants, RigidImpact and ModalImpacts read them. Invariant: between begin() and end() every body of the island, and no other,
/// has its index in island().bodies.
class Step {
 public:
  explicit Step(Bodies& bodies) : bodies_(bodies), index_(bodies, -1) {}

  void begin(Island& island);
  void end();
  /// Adds a woken body.
  void add(int body);

  Island& island() const { return *island_; }
  int count() const { return static_cast<int>(island_->bodies.size()); }
  int body(int n) const { return island_->bodies[n]; }
  /// -1: not in the island, or static.
  int find(int body) const { return bodies_.moves(body) ? index_[body] : -1; }
  /// True if the body is in the island or static.
  bool has(int body) const { return !bodies_.moves(body) || index_[body] >= 0; }
  /// False for touches with bodies of another island, found in this step; they wait for the next.
  bool has(const Pair& pair) const { return has(pair.a) && has(pair.b); }

  double length_s = 0.0;    // of the predicted part
  double together_s = 0.0;  // touches nearer in time are one impact
  std::vector<Mover> movers;
  std::vector<FreeMotion> free;
  std::vector<ArticulationStep> articulations;
  std::vector<joints::Spatial> loads;  // impulses of sleeping bodies on these
  std::vector<joints::Spatial> pulls;  // impulses of grabs on these; empty: none
  std::vector<Point> points;
  std::vector<ContactRef> rows;  // contact of each point
  std::vector<Vec3> turned;      // angular impulses on the bodies

  /// The nth body after a part of the step, with contact impulses acting all along.
  State calc_moved(int n, double part_s) const;
  joints::Coordinates calc_moved(const ArticulationStep& articulation, double part_s) const;
  /// Energy lost at a point in the first part of the step [J]: its impulses times the mean velocities.
  double calc_loss(const Point& point, double part) const;
  /// Work of the loads on the nth body in a part of the step that ends at `to` [J].
  double calc_load_work(int n, const State& to, double part_s) const;
  /// Work of the pulls on the nth body, now moved by a part of the step from `from` [J].
  double calc_pull_work(int n, const State& from, double part_s) const;

 private:
  const Bodies& bodies_;
  Island* island_ = nullptr;
  PerBody<int> index_;
};

/// Point of a contact between bodies of the step, current geometry.
Point make_point(const Bodies& bodies, const Step& step, const Contact& contact);

/// Adds a force at a contact to the body a (or b).
void add_pull(const Bodies& bodies, const Contact& contact, bool is_a, const Vec3& force_n, joints::Spatial& pull);

}  // namespace carillon::rigid
