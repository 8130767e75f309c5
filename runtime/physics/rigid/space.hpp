// Bodies that fall, strike, slide, roll and rest: their motion in small steps on persistent contacts.
//
// Time is divided into windows of 2 ms. Bodies that can meet nothing within a window fly through it in closed form. The others take small
// steps. The velocities at the end of each step follow from one complementarity problem over all touching points (solver.hpp), started from
// the impulses of the previous step; positions follow from the mean of both velocities, so that non-slipping contacts and impacts conserve
// energy. Fast touches are excluded: the step ends at their instant, and the impact is solved separately. An island that is balanced with
// zero velocity is put to sleep.
//
// The stages of a step: Windows, TouchSets, Projection, Rest, StepProblem, Instants, RigidImpact, ModalImpacts, on the Bodies and their
// ModalStates; each keeps its own state, and receives that of a step as a Step. All book their losses in the Ledger.
#pragma once

#include <algorithm>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "runtime/physics/rigid/bodies.hpp"
#include "runtime/physics/rigid/contact.hpp"
#include "runtime/physics/rigid/instants.hpp"
#include "runtime/physics/rigid/ledger.hpp"
#include "runtime/physics/rigid/links.hpp"
#include "runtime/physics/rigid/modal_impact.hpp"
#include "runtime/physics/rigid/modal_states.hpp"
#include "runtime/physics/rigid/options.hpp"
#include "runtime/physics/rigid/projection.hpp"
#include "runtime/physics/rigid/rest.hpp"
#include "runtime/physics/rigid/rigid_impact.hpp"
#include "runtime/physics/rigid/step_problem.hpp"
#include "runtime/physics/rigid/touch_sets.hpp"
#include "runtime/physics/rigid/windows.hpp"

namespace carillon::rigid {

/// All bodies of a simulation and their contacts. At the start of a window all bodies are at its time. Fixed and sleeping bodies do not
/// move, joints stay closed, and the energies of calc_books() have a constant sum. Islands are stepped independently.
class Space {
 public:
  static constexpr double kWindow = Windows::kLength;  // s

  /// Bodies on joints must form trees (joints::make_mechanism); their velocities are projected onto the motions permitted by the joints.
  Space(std::vector<Solid> solids, std::vector<State> states, std::optional<Ground> ground, const Vec3& gravity, const Options& options,
        const Links& links = {});
  Space(const Space&) = delete;  // stages refer to each other
  Space& operator=(const Space&) = delete;

  // At the start of a window only. Energy from outside is booked as given; bodies that sleep wake.
  /// Impulse on a moving body at a world point [N s].
  void push(int body, const Vec3& where, const Vec3& impulse);
  /// Holds a moving body by a spring, instead of an earlier one.
  void grab(const Grab& grab);
  void release(int body) { bodies_.drop_grab(body); }
  void allow_modal_impacts(bool may_begin) { modal_impacts_.allow(may_begin); }
  const Grab* find_grab(int body) const { return bodies_.find_grab(body); }
  /// Takes a body without joints and cords out of the world; wakes those that touch it.
  void remove(int body);
  /// The same for a body that is not in the world from the start: nothing is booked.
  void leave_out(int body) { bodies_.set_absent(body, true); }
  /// A new body without joints, which stays out of the world. Returns its number.
  int append(Solid solid, const State& state);
  /// Puts an absent body into the world.
  void add(int body, const State& state);
  bool is_absent(int body) const { return bodies_.is_absent(body); }

  /// One small step of all awake bodies, to at most `until_s`. At the start of a window all bodies are at its time; within it flying bodies
  /// are at its end. Throws SolveError if a state is not finite.
  void step(double until_s);
  double get_time() const { return bodies_.get_time(); }
  bool is_at_window() const { return at_window_; }
  /// Start of the window of the last step.
  double get_window_start() const { return windows_.get_start(); }

  const Solid& solid(int body) const { return bodies_.solid(body); }
  const State& state(int body) const { return bodies_.state(body); }
  const std::vector<State>& states() const { return bodies_.states(); }
  /// Fixed or asleep; not absent, so that its contacts end.
  bool is_still(int body) const { return !bodies_.moves(body) && !bodies_.is_absent(body); }
  bool is_all_asleep() const { return bodies_.are_all_asleep(); }
  /// If all bodies sleep: advances to the end of the next window without a step.
  void skip_window(double end_s);
  /// Velocity of a body at a point [m/s]; zero for the ground and fixed bodies.
  Vec3 calc_velocity(int body, const Vec3& where) const { return bodies_.calc_velocity(body, where); }
  geometry::Frame get_frame(int body) const { return bodies_.get_frame(body); }
  const Placed& placed(int body) const { return bodies_.placed(body); }
  /// Contacts of bodies that are awake.
  void list_contacts(std::vector<const Contact*>& out) const;
  /// Pairs of bodies near in this window, and of static or sleeping ones that touch. b: -1 for the ground, or greater than a.
  const std::map<std::pair<int, int>, Pair>& pairs() const { return touches_.pairs(); }
  /// Depth of a pair explained or left by a modal impact [m].
  double calc_explained_depth(int a, int b) const {
    const auto at = pairs().find({a, b});
    return at == pairs().end() ? 0.0 : touches_.calc_explained_depth(at->second);
  }
  /// Returns the impacts since the last call.
  std::vector<Strike> take_strikes() { return std::exchange(strikes_, {}); }
  /// Returns the forces of modal impacts since the last call.
  std::vector<Forces> take_forces() { return modal_impacts_.take_forces(); }
  Books calc_books() const;
  int count_mechanisms() const { return static_cast<int>(bodies_.articulations().size()); }
  /// Difference between the given start velocity and the motions permitted by the joints of a body [m/s]; 0 without joints.
  double get_start_error(int body) const { return bodies_.get_start_error(body); }
  /// True if a joint connects the two bodies; they do not collide.
  bool is_joined(int a, int b) const { return bodies_.is_joined(a, b); }
  /// Groups of moving bodies that may touch each other in the current window.
  int count_islands() const { return windows_.count_islands(); }
  const Costs& get_costs() const { return ledger_.costs; }
  const std::optional<Ground>& ground() const { return bodies_.ground(); }
  const Vec3& gravity() const { return bodies_.gravity(); }

 private:
  void open_window(double end_s);
  double calc_open_depth(const Island& island) const;
  double begin_part(double left_s, double open_m, bool& has_struck);
  void step_island(Island& island, double start_s, double length_s);
  bool try_rest(Island& island, double length_s);
  bool strike_at_once(double start_s, double length_s);
  void move(double to_s, double part_s);
  void pull_joints(const Island& island, double length_s);
  double give_pulls(const std::vector<State>& before, const std::vector<char>& in_impact, double part_s);
  void stir(int body);
  void strike(const std::vector<ContactRef>& first);
  void extend_in_impacts();
  void extend(const std::vector<int>& struck, double least_m_s = 0.0);

  Options options_;
  Ledger ledger_;
  Bodies bodies_;
  ModalStates modal_states_;
  ModalImpacts modal_impacts_;
  TouchSets touches_;
  Windows windows_;
  Projection projection_;
  StepProblem problem_;
  Instants instants_;
  RigidImpact rigid_impact_;
  Rest rest_;
  Step step_;  // current step
  std::vector<Strike> strikes_;
  bool at_window_ = true;
};

}  // namespace carillon::rigid
