// Which bodies sleep, and until when.
#pragma once

#include <vector>

#include "runtime/physics/rigid/options.hpp"
#include "runtime/physics/rigid/step.hpp"
#include "runtime/physics/rigid/step_problem.hpp"
#include "runtime/physics/rigid/touch_sets.hpp"
#include "runtime/physics/rigid/windows.hpp"

namespace carillon::rigid {

/// Puts bodies to sleep that contact forces balance, and wakes them where these forces change. Invariant: a sleeping body has no velocity,
/// and its contacts keep the forces under which it fell asleep.
class Rest {
 public:
  Rest(Bodies& bodies, TouchSets& touches, Windows& windows, StepProblem& problem, const Options& options, Ledger& ledger)
      : bodies_(bodies),
        touches_(touches),
        windows_(windows),
        problem_(problem),
        options_(options),
        ledger_(ledger),
        trial_(bodies),
        paces_(bodies.count()) {}

  /// These bodies are not about to rest.
  void reset(const std::vector<int>& bodies);
  /// Adds up the time for which bodies have been slow; true where a proof of rest may be tried.
  bool may_sleep(const std::vector<int>& bodies, double time_s);
  /// Puts an island to sleep where it is balanced at rest. True: it sleeps.
  bool try_island(Island& island, double step_s) { return try_sleep(island, step_s, {}) != Balance::none; }
  /// The same of bodies whose island keeps moving elsewhere. At the beginning of a window, on the contacts of the last step.
  void try_parts();
  /// The same of an articulation that touches nothing for the length of a window.
  bool try_articulation(Articulation& articulation, double length_s);

  /// Updates the touches of a pair for a step. A sleeping body of it wakes where a contact that it rested on has opened, or where another
  /// body is about to touch it.
  void watch(Pair& pair, double step_s);
  /// Wakes the bodies that sleep among others whose forces on them are no longer those under which they rest.
  void wake_unbalanced();
  /// Bodies of an impact that slept until now move from here on, in this island. True if there were any. If another island touches them,
  /// too, that touch waits for the next step, in which the islands are one (they take the same steps: Windows::choose_steps()).
  bool wake_struck(Step& step, const std::vector<ContactRef>& contacts);

 private:
  /// The recent speed of a body, and when to look again.
  struct Pace {
    double slow_s = 0.0;        // it has been slow for so long
    double next_proof_s = 0.0;  // when rest may be looked for again,
    double next_part_s = 0.0;   // that of a part of its island
  };
  enum class Balance { none, stands, leans };  // leans: only with the forces of others

  Balance try_sleep(Island& island, double step_s, const std::vector<joints::Spatial>& pulls);
  std::vector<char> find_slow() const;
  std::vector<int> wake(int body, int by, bool alone = false);

  Bodies& bodies_;
  TouchSets& touches_;
  Windows& windows_;
  StepProblem& problem_;
  const Options& options_;
  Ledger& ledger_;
  Step trial_;  // with zero velocities
  std::vector<Pace> paces_;
};

}  // namespace carillon::rigid
