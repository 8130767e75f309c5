// Bodies that fall, strike, slide, roll and rest: their motion in small steps, on contacts that have an identity.
//
// Time goes in windows of 2 ms. Bodies that can meet nothing within one fly through it in closed form. The others go through it in small
// steps. In each of them the velocities at its end follow from one complementarity problem over all points that touch (solver.hpp), begun
// at the impulses of the step before; places follow from the mean of both velocities, so that contacts without slip and impacts keep the
// energy. A touch that comes fast is no part of that: its instant is found, the step ends there, and the impact is solved by itself.
// An island that a solution with zero velocity balances is put to sleep.
//
// The stages of a step: Windows, TouchSets, Projection, Rest, StepProblem, Instants, RigidImpact, ModalImpacts, on the Bodies and their
// ModalStates; each keeps its own state, and gets that of a step as a Step. All book their losses in the Ledger.
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
/// move, bodies on joints never leave them, and the energies of calc_books() have a constant sum. Islands are stepped apart.
class Space {
 public:
  static constexpr double kWindow = Windows::kLength;  // s

  /// Bodies on joints must make trees (joints::make_mechanism), and their velocities are projected onto the motions that the joints allow.
  Space(std::vector<Solid> solids, std::vector<State> states, std::optional<Ground> ground, const Vec3& gravity, const Options& options,
        const Links& links = {});
  Space(const Space&) = delete;  // stages refer to each other
  Space& operator=(const Space&) = delete;

  /// One small step of all that is not asleep, to at most `until_s`. At the start of a window all bodies are at its time; within it those
  /// that fly are at its end. Throws SolveError where a state is not finite.
  void step(double until_s);
  double get_time() const { return bodies_.get_time(); }
  bool is_at_window() const { return at_window_; }
  /// Of the window of the last step.
  double get_window_start() const { return windows_.get_start(); }

  const Solid& solid(int body) const { return bodies_.solid(body); }
  const State& state(int body) const { return bodies_.state(body); }
  const std::vector<State>& states() const { return bodies_.states(); }
  /// Fixed or asleep.
  bool is_still(int body) const { return !bodies_.moves(body); }
  bool is_all_asleep() const { return bodies_.are_all_asleep(); }
  /// Where all is asleep: to the end of the next window, without a step.
  void skip_window(double end_s);
  /// Velocity of the point of a body at that place [m/s]; zero for the ground and fixed bodies.
  Vec3 calc_velocity(int body, const Vec3& where) const { return bodies_.calc_velocity(body, where); }
  geometry::Frame get_frame(int body) const { return bodies_.get_frame(body); }
  const Vec3& get_spin(int body) const { return bodies_.placed(body).spin; }
  /// Contacts of bodies that are awake.
  void list_contacts(std::vector<const Contact*>& out) const;
  /// Of bodies that are near in this window, and of still ones that touch. b: -1 for the ground, or greater than a.
  const std::map<std::pair<int, int>, Pair>& pairs() const { return touches_.pairs(); }
  /// Depth of a pair explained or left by an impact with modes [m].
  double calc_explained_depth(int a, int b) const {
    const auto at = pairs().find({a, b});
    return at == pairs().end() ? 0.0 : std::max(at->second.sag_m, modal_impacts_.calc_depth(at->second));
  }
  /// Impacts since the last call.
  std::vector<Strike> take_strikes() { return std::exchange(strikes_, {}); }
  /// Forces of impacts with modes since the last call.
  std::vector<Forces> take_forces() { return modal_impacts_.take_forces(); }
  Books calc_books() const;
  /// Duration of an impact (calc_hertz_duration) of that effective mass and speed [s].
  double calc_contact_time(const Hit& hit, double mass_kg, double speed_m_s) const {
    return bodies_.calc_contact_time(hit.touch, hit.a, hit.b, mass_kg, speed_m_s);
  }
  int count_mechanisms() const { return static_cast<int>(bodies_.articulations().size()); }
  /// Difference between the velocity given at the start and the motions that the joints of a body allow [m/s]; 0 without joints.
  double get_start_error(int body) const { return bodies_.get_start_error(body); }
  /// Does a joint hold the two together, so that they do not collide?
  bool is_joined(int a, int b) const { return bodies_.is_joined(a, b); }
  /// Groups of moving bodies that may touch each other in the present window.
  int count_islands() const { return windows_.count_islands(); }
  const Costs& get_costs() const { return ledger_.costs; }
  const std::optional<Ground>& ground() const { return bodies_.ground(); }
  const Vec3& gravity() const { return bodies_.gravity(); }

 private:
  void open_window(double end_s);
  void step_island(Island& island, double start_s, double length_s);
  bool try_rest(Island& island, double length_s);
  bool strike_at_once(double start_s, double length_s);
  void move(double to_s, double part_s);
  void strike(const std::vector<ContactRef>& first);

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
  Step step_;  // that is being made
  std::vector<Strike> strikes_;
  bool at_window_ = true;
};

}  // namespace carillon::rigid
