// The velocity problem of a step: made, solved, and written back into its contacts.
#pragma once

#include <vector>

#include "runtime/physics/rigid/options.hpp"
#include "runtime/physics/rigid/step.hpp"
#include "runtime/physics/rigid/touch_sets.hpp"

namespace carillon::rigid {

/// Makes and solves the complementarity problem over all touches of a step that last. Invariant: whatever the solution, contacts take
/// energy from the motion without them, or none.
class StepProblem {
 public:
  StepProblem(Bodies& bodies, const TouchSets& touches, const Options& options, Ledger& ledger)
      : bodies_(bodies), touches_(touches), options_(options), ledger_(ledger), next_guess_s_(bodies.count(), 0.0) {}

  /// The motion of every body without contacts in a step of that length; `at_rest`: as if it had no velocity.
  void predict(Step& step, double length_s, bool at_rest);
  /// The touches that are in the problem. `leaves_impacts`: without those that will strike.
  void make_points(Step& step, bool leaves_impacts) const;
  /// Small islands by factorisation; large ones in sweeps, which begin at the impulses of the step before.
  void solve(Step& step);
  /// Are there contact forces that balance the bodies of an island, which have no velocity? They are in the step then. `pulls`: forces and
  /// couples of others on each body, or empty. The longer a body has been slow, the less balance is enough.
  bool solve_rest(Step& step, double length_s, const std::vector<joints::Spatial>& pulls, double slow_s);
  /// Writes impulses and losses into the contacts; the first `at_s` of the step is made.
  void keep_impulses(const Step& step, double at_s) const;
  /// Contacts do no work on an island, except for rounding, for contacts that are pushed out and for surfaces whose curvature changes
  /// within a step. Such a gain is taken from the motion, where the island touches a static body (a free one would lose momentum).
  void remove_gain(const Step& step, double before_j);

 private:
  void predict_articulation(Step& step, int number, bool at_rest);
  void add_loads(Step& step) const;
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
  std::vector<double> next_guess_s_;  // of each body: when factorisation may be tried again
};

}  // namespace carillon::rigid
