// Separation of bodies with deep penetrations.
#pragma once

#include <vector>

#include "runtime/physics/rigid/bodies.hpp"
#include "runtime/physics/rigid/modal_states.hpp"
#include "runtime/physics/rigid/solver.hpp"
#include "runtime/physics/rigid/step.hpp"
#include "runtime/physics/rigid/touch_sets.hpp"

namespace carillon::rigid {

/// Displaces the bodies of an island so that no touch is deeper than allowed, by the least displacement in the mass norm. Invariants: a
/// free island keeps its momentum and angular momentum; energy that motion cannot pay for at once is booked as lifted, and taken from the
/// displaced bodies when they move. Bodies on joints are not moved. Bodies in modal impacts return to the depth that their springs and
/// modes explain; these stay as they are.
class Projection {
 public:
  Projection(Bodies& bodies, TouchSets& touches, ModalStates& modes, Ledger& ledger)
      : bodies_(bodies), touches_(touches), modes_(modes), ledger_(ledger), owed_j_(bodies) {}

  /// Takes the energy that bodies owe from their motion. Call at the start of a step, before run().
  void collect(const Step& step);
  /// Call at the start of a step. Separates touches deeper than `allowed_m` plus the depth explained at them `step_s` later.
  void run(const Step& step, double allowed_m, double step_s);
  /// Energy that a body owes, for a return to an earlier state.
  double get_owed(int body) const { return owed_j_[body]; }
  void set_owed(int body, double owed_j) { owed_j_[body] = owed_j; }

 private:
  bool is_movable(int body) const { return bodies_.moves(body) && bodies_.find_articulation(body) == nullptr; }
  /// Its motion can pay: not that of a modal impact.
  bool can_pay(int body) const { return is_movable(body) && !bodies_.is_moved_by_impact(body); }
  bool can_part(const Step& step, const Pair& pair) const;
  double find_excess(const Step& step, double step_s) const;
  std::vector<Point> make_points(const Step& step, double step_s, bool& is_held) const;
  void limit(const Step& step, double most_m, std::vector<Mover>& displacements) const;
  void move(const Step& step, const std::vector<Mover>& displacements, bool is_held);
  void owe(const Step& step, const std::vector<Mover>& displacements, double gained_j);
  void pay(const Step& step, const std::vector<Mover>& displacements, double owed_j);
  Vec3 calc_angular_momentum(const Step& step) const;
  void turn(const Step& step, const Vec3& gained);

  Bodies& bodies_;
  TouchSets& touches_;
  ModalStates& modes_;
  Ledger& ledger_;
  Solver solver_;
  PerBody<double> owed_j_;
};

}  // namespace carillon::rigid
