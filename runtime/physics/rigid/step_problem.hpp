// Velocity problem of a step: setup, solution and write-back to its contacts.
#pragma once

#include <vector>

#include "runtime/physics/rigid/options.hpp"
#include "runtime/physics/rigid/step.hpp"
#include "runtime/physics/rigid/touch_sets.hpp"

namespace carillon::rigid {

/// Builds and solves the complementarity problem over all persistent touches of a step. Invariant: contacts never add energy to the motion
/// without them, for any solution.
class StepProblem {
 public:
  StepProblem(Bodies& bodies, const TouchSets& touches, const Options& options, Ledger& ledger)
      : bodies_(bodies), touches_(touches), options_(options), ledger_(ledger), next_guess_s_(bodies) {}

  /// Motion of every body without contacts in a step of that length; `at_rest`: from zero velocity.
  void predict(Step& step, double length_s, bool at_rest);
  /// Points of the touches in the problem. `leaves_impacts`: without those that will strike.
  void make_points(Step& step, bool leaves_impacts) const;
  /// Small islands by factorisation; large ones by sweeps, started from the impulses of the previous step.
  void solve(Step& step);
  /// True if contact forces balance the motionless bodies of an island; they are in the step then. `pulls`: external forces and couples on
  /// each body, or empty. The tolerance grows with the slow time of the bodies.
  bool solve_rest(Step& step, double length_s, const std::vector<joints::Spatial>& pulls, double slow_s);
  /// Writes impulses and losses to the contacts, for the first `at_s` of the step.
  void keep_impulses(const Step& step, double at_s) const;
  /// Contacts do no work on an island, except for rounding, removal of penetration, and surfaces whose curvature changes within a step.
  /// Such a gain is taken from the motion if the island touches a static body (a free island would lose momentum).
  void remove_gain(const Step& step, double before_j);

 private:
  void predict_articulation(Step& step, int number, bool at_rest);
  void add_loads(Step& step) const;
  void add_pulls(Step& step) const;
  double calc_rolling_radius(const Step& step, const Point& point, const Contact& contact, const geometry::Touch& moved) const;
  Point make_lasting_point(const Step& step, Pair& pair, const Contact& contact) const;
  double calc_patch_radius(const Contact& contact) const;
  static bool gains_energy(const std::vector<Mover>& free, const Step& step);
  void find_impulses(Step& step);
  void sum_impulses(Step& step) const;

  Bodies& bodies_;
  const TouchSets& touches_;
  const Options& options_;
  Ledger& ledger_;
  Solver solver_;
  PerBody<double> next_guess_s_;  // time of the next factorisation
};

}  // namespace carillon::rigid
