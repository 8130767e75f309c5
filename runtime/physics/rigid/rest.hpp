// Sleeping bodies.
#pragma once

#include <vector>

#include "runtime/physics/rigid/options.hpp"
#include "runtime/physics/rigid/step.hpp"
#include "runtime/physics/rigid/step_problem.hpp"
#include "runtime/physics/rigid/touch_sets.hpp"
#include "runtime/physics/rigid/windows.hpp"

namespace carillon::rigid {

/// Puts bodies to sleep that contact forces balance, and wakes them when these forces change. Invariant: a sleeping body has no velocity,
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
        paces_(bodies) {}

  /// Restarts the slow time of these bodies.
  void reset(const std::vector<int>& bodies);
  /// Accumulates the slow time of bodies; true if a test of rest is due.
  bool may_sleep(const std::vector<int>& bodies, double time_s);
  /// Puts an island to sleep if it is balanced at rest; true if so.
  bool try_island(Island& island, double step_s) { return try_sleep(island, step_s, {}) != Balance::none; }
  /// Updates how long each body has stayed in place. Call at the start of a window.
  void note_still();
  /// Updates the resistance of bodies that swing in place on others. Call at the start of a window.
  void note_swings();
  /// Puts an island to sleep whose bodies have stayed in place, without proof of balance. True if it sleeps.
  bool try_still(Island& island, double step_s);
  /// Puts bodies to sleep whose island keeps moving elsewhere. Call at the start of a window; uses the contacts of the last step.
  void try_parts();
  /// Puts an articulation to sleep that touches nothing during a window.
  bool try_articulation(Articulation& articulation, double length_s);

  /// Wakes a body and the sleeping bodies connected to it, at the start of a window.
  void wake(int body) { wake(body, body); }
  /// Updates the touches of a pair for a step. Wakes a sleeping body of the pair if a supporting contact has opened, or if another body is
  /// about to touch it.
  void watch(Pair& pair, double step_s);
  /// Wakes sleeping bodies whose contact forces from moving bodies have changed.
  void wake_unbalanced();
  /// Adds sleeping bodies of an impact to this island; true if there were any. If another island touches them too, that touch waits for the
  /// next step, in which the islands are merged (both use the same steps: Windows::choose_steps()).
  bool wake_struck(Step& step, const std::vector<ContactRef>& contacts);

 private:
  /// Slow time of a body, and time of the next test.
  struct Pace {
    double slow_s = 0.0;        // duration of slow motion
    double next_proof_s = 0.0;  // next test of rest,
    double next_part_s = 0.0;   // that of a part of its island
    State anchor;               // pose at which it has stayed in place
    double anchored_s = 0.0;    // since this time
    State swing;                // pose about which it swings,
    double swings_s = 0.0;      // since this time
  };
  enum class Balance { none, stands, leans };  // leans: only with the forces of others

  static void fall_asleep(Contact& contact, const Vec3& impulse, double step_s);
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
  PerBody<Pace> paces_;
};

}  // namespace carillon::rigid
