// Bodies of a simulation: properties, states and frames; bodies on joints in joint coordinates.
#pragma once

#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "runtime/physics/impact/impact.hpp"
#include "runtime/physics/joints/mechanism.hpp"
#include "runtime/physics/rigid/body.hpp"
#include "runtime/physics/rigid/ledger.hpp"

namespace carillon::rigid {

/// The half space z <= height_m.
struct Ground {
  double height_m = 0.0;
  double restitution = 0.5, friction = 0.5;
  double young_modulus_pa = 0.0, poisson_ratio = 0.0;
  double rolling_resistance = 1e-3;
};

/// Bodies on joints, moved in joint coordinates (runtime/physics/joints).
struct Articulation {
  std::unique_ptr<joints::Mechanism> mechanism;
  std::vector<int> bodies;   // its members
  bool is_anchored = false;  // by a joint to a static body or the world
  joints::Coordinates now;
  int struck = -1;  // member that an impact with modes moves; -1: none
};

/// A damped spring from a point of a body to a target that moves evenly from one place to another, and then stays.
struct Grab {
  int body = 0;
  Vec3 at{};  // mesh axes, from the centre of mass
  double stiffness_n_m = 0.0, damping_n_s_m = 0.0, max_force_n = 0.0;
  Vec3 from_m{}, to_m{};
  double from_s = 0.0, to_s = 0.0;

  Vec3 find_target(double time_s) const { return time_s >= to_s ? to_m : from_m + ((time_s - from_s) / (to_s - from_s)) * (to_m - from_m); }
  Vec3 find_velocity(double time_s) const { return time_s > to_s ? Vec3{} : (1.0 / (to_s - from_s)) * (to_m - from_m); }
};

/// Entries of a PerBody, of any type.
class BodyTable {
 public:
  virtual void resize(int count) = 0;

 protected:
  ~BodyTable() = default;
};

/// All bodies and the ground, body -1. Invariants: fixed, sleeping and absent bodies do not move; absent ones meet nothing; frames and
/// spins match the states, except between a change of state() and the following place(); bodies on joints match the coordinates of their
/// articulation.
class Bodies {
 public:
  /// Bodies on joints must form trees (joints::make_mechanism); their velocities are projected onto the motions permitted by the joints.
  Bodies(std::vector<Solid> solids, std::vector<State> states, std::optional<Ground> ground, const Vec3& gravity,
         const std::vector<joints::Joint>& joints = {}, double joint_tolerance = joints::kTolerance);

  /// Adds a body without joints, absent at first, and an entry to every PerBody.
  void append(Solid solid, const State& state);

  int count() const { return static_cast<int>(solids_.size()); }
  const Solid& solid(int body) const { return solids_[body]; }
  const State& state(int body) const { return states_[body]; }
  /// Call place() after a change.
  State& state(int body) { return states_[body]; }
  const std::vector<State>& states() const { return states_; }
  const Placed& placed(int body) const { return placed_[body]; }
  const std::optional<Ground>& ground() const { return ground_; }
  const Vec3& gravity() const { return gravity_; }
  /// nullptr: the ground.
  const geometry::Shape* get_shape(int body) const { return body >= 0 ? solids_[body].shape.get() : nullptr; }
  geometry::Frame get_frame(int body) const { return body >= 0 ? placed_[body].frame : geometry::Frame{}; }
  /// Updates frame and spin from the state. Throws SolveError if the state is not finite.
  void place(int body);
  /// Time of the states.
  void set_time(double time_s) { time_s_ = time_s; }
  double get_time() const { return time_s_; }

  bool is_fixed(int body) const { return body < 0 || solids_[body].fixed; }
  bool is_asleep(int body) const { return body >= 0 && stays_[body] == kAsleep; }
  /// Taken out of the world.
  bool is_absent(int body) const { return body >= 0 && stays_[body] == kAbsent; }
  bool moves(int body) const { return !is_fixed(body) && stays_[body] == kAwake; }
  void set_asleep(int body, bool sleeps) { stays_[body] = sleeps ? kAsleep : kAwake; }
  void set_absent(int body, bool is_absent) { stays_[body] = is_absent ? kAbsent : kAwake; }
  bool are_all_asleep() const;
  bool has_modes(int body) const { return body >= 0 && solids_[body].modes != nullptr; }
  /// True if the surface has no curved parts.
  bool is_flat(int body) const { return body < 0 || solids_[body].shape->is_polyhedron(); }
  /// True if the body or its modes take part in a modal impact.
  bool is_in_impact(int body) const { return body >= 0 && in_impact_[body] != 0; }
  /// Start and end of a modal impact count as blows.
  void set_in_impact(int body, bool is_in) {
    in_impact_[body] = is_in ? 1 : 0;
    note_struck(body);
  }
  void note_struck(int body) { struck_s_[body] = get_time(); }
  double get_struck_s(int body) const { return struck_s_[body]; }  // time of the last impact
  /// Bound of the displacement of the surface by modes between impacts [m].
  double get_swing(int body) const { return body >= 0 ? swings_m_[body] : 0.0; }
  void set_swing(int body, double swing_m) { swings_m_[body] = swing_m; }
  /// True if a modal impact moves the body or its articulation.
  bool is_moved_by_impact(int body) const {
    if (!moves(body)) return false;
    const Articulation* articulation = find_articulation(body);
    return articulation != nullptr ? articulation->struck >= 0 : is_in_impact(body);
  }

  /// Velocity of a body at a point [m/s]; zero for the ground and fixed bodies.
  Vec3 calc_velocity(int body, const Vec3& where) const;
  /// Closing speed of the surfaces of a and b at a touch [m/s].
  double calc_approach(const geometry::Touch& touch, int a, int b) const;
  /// Upper bound of the speed of any point of a body about its centre [m/s].
  double calc_turning_speed(int body) const;
  /// Upper bound of the vertical speed of any point of a body [m/s].
  double calc_sinking_speed(int body) const;
  /// Upper bound of the closing speed of any two points of a pair [m/s].
  double calc_closing_speed(int a, int b) const;
  /// Upper bound of the speed of any point of a body [m/s].
  double calc_speed(int body) const { return norm(states_[body].velocity) + norm(placed_[body].spin) * solids_[body].radius_m; }
  geometry::Box calc_box(int body, double grown_m) const;
  /// About the centre, world axes [kg m^2].
  Mat3 calc_inertia(int body) const { return placed_[body].rotation * (solids_[body].inertia_kg_m2 * transpose(placed_[body].rotation)); }
  /// Kinetic and gravitational energy [J].
  double calc_energy(const std::vector<int>& bodies) const;
  double calc_kinetic(const std::vector<int>& bodies) const;
  /// Adds the energy of motion and the losses in joints.
  void add_to(Books& books) const;

  // Of two touching bodies, or of one and the ground:
  double calc_friction(int a, int b) const;
  double calc_rolling_resistance(int a, int b) const;
  double calc_restitution(int a, int b) const;
  double calc_size(int a, int b) const;        // of the smaller one [m]
  double calc_thickness(int a, int b) const;   // of the thinner one [m]
  double calc_compliance(int a, int b) const;  // 1/E* [1/Pa]
  /// 1/R is the summed curvature, clamped between the curvature for half the size of the smaller body and 1/(0.5 mm).
  double calc_contact_radius(const geometry::Touch& touch, int a, int b) const;
  /// Duration of an impact at the touch for an effective mass and speed [s].
  double calc_contact_time(const geometry::Touch& touch, int a, int b, double mass_kg, double speed_m_s) const {
    return impact::calc_hertz_duration(calc_compliance(a, b), calc_contact_radius(touch, a, b), mass_kg, speed_m_s);
  }

  const std::vector<Grab>& grabs() const { return grabs_; }
  const Grab* find_grab(int body) const;
  /// Adds a grab, or replaces that of its body.
  void set_grab(const Grab& grab);
  void drop_grab(int body);
  /// Bound of the acceleration of any point by a grab of the body or of its articulation [m/s^2]; 0: not grabbed.
  double get_pull(int body) const { return grabs_.empty() || body < 0 ? 0.0 : pulls_m_s2_[body]; }

  /// Factor of the couples that resist rolling and drilling of bodies that swing in place; 1 elsewhere (Rest::note_swings).
  double calc_settling(int a, int b) const;
  void set_settling(int body, double factor) { settling_[body] = factor; }

  std::vector<Articulation>& articulations() { return articulations_; }
  const std::vector<Articulation>& articulations() const { return articulations_; }
  Articulation* find_articulation(int body) {
    return body >= 0 && !articulations_.empty() && articulation_of_[body] >= 0 ? &articulations_[articulation_of_[body]] : nullptr;
  }
  const Articulation* find_articulation(int body) const { return const_cast<Bodies*>(this)->find_articulation(body); }
  /// Index of the body in its articulation.
  int get_member(int body) const { return member_[body]; }
  /// True for the same body or members of one articulation.
  bool share_motion(int a, int b) const {
    return a == b || (find_articulation(a) != nullptr && find_articulation(a) == find_articulation(b));
  }
  /// True if a joint connects the two bodies; they do not collide.
  bool is_joined(int a, int b) const { return !joined_.empty() && joined_.contains(std::minmax(a, b)); }
  /// Difference between the given start velocity and the motions permitted by the joints of a body [m/s]; 0 without joints.
  double get_start_error(int body) const;
  /// Motion by `time_s` without contacts. Throws SolveError if the integration fails.
  joints::Coordinates fly(const Articulation& articulation, const joints::Coordinates& from, double time_s) const;
  /// Updates the states of the members from the coordinates.
  void place(const Articulation& articulation);
  State make_member_state(int body, const joints::Motion& motion) const;
  /// Applies simultaneous impulses, one per member.
  void apply_impulses(Articulation& articulation, const std::vector<joints::Spatial>& impulses);
  /// Applies an impulse to a body; returns the kinetic energy gained [J].
  double apply_impulse(int body, const joints::Spatial& impulse);
  /// Bound of the acceleration of any point due to joints: twice the present one [m/s^2].
  double calc_joint_acceleration(const Articulation& articulation) const;
  /// True if the articulation is in equilibrium without velocity and contacts.
  bool is_balanced(const Articulation& articulation) const;
  /// Velocity and spin of a member per linear and angular impulse on itself.
  impact::Mobility calc_own_mobility(const Articulation& articulation, int member) const;
  /// Calls act for every articulation among `bodies`; either all or no members of an articulation are included.
  template <typename Do>
  void for_articulations(const std::vector<int>& bodies, Do&& act) {
    if (articulations_.empty()) return;
    for (const int body : bodies)
      if (Articulation* articulation = find_articulation(body); articulation != nullptr && articulation->bodies.front() == body)
        act(*articulation);
  }

  // Of PerBody:
  void track(BodyTable& table) { tables_.push_back(&table); }
  void forget(const BodyTable& table) { std::erase(tables_, &table); }

 private:
  enum Stay : char { kAwake, kAsleep, kAbsent };

  void make_articulations(const std::vector<joints::Joint>& joints);
  void note_pulls();

  std::vector<Solid> solids_;
  std::vector<State> states_;
  std::vector<Placed> placed_;
  std::vector<char> stays_;  // Stay
  std::vector<char> in_impact_;
  std::vector<double> struck_s_;
  std::vector<double> swings_m_;
  std::vector<Grab> grabs_;
  std::vector<double> settling_;    // of the bodies
  std::vector<double> pulls_m_s2_;  // of the bodies; empty without grabs
  std::optional<Ground> ground_;
  Vec3 gravity_{};
  std::vector<Articulation> articulations_;
  std::vector<int> articulation_of_, member_;  // of each body; empty without joints
  std::set<std::pair<int, int>> joined_;       // pairs that do not collide
  double joint_tolerance_ = joints::kTolerance, time_s_ = 0.0;
  std::vector<BodyTable*> tables_;
};

/// Data of a stage, an entry per body; new bodies get `fresh`.
template <class T>
class PerBody final : private BodyTable {
 public:
  explicit PerBody(Bodies& bodies, T fresh = {}) : bodies_(bodies), fresh_(std::move(fresh)), entries_(bodies.count(), fresh_) {
    bodies_.track(*this);
  }
  ~PerBody() { bodies_.forget(*this); }
  PerBody(const PerBody&) = delete;
  PerBody& operator=(const PerBody&) = delete;

  T& operator[](int body) { return entries_[body]; }
  const T& operator[](int body) const { return entries_[body]; }

 private:
  void resize(int count) override { entries_.resize(count, fresh_); }

  Bodies& bodies_;
  T fresh_;
  std::vector<T> entries_;
};

}  // namespace carillon::rigid
