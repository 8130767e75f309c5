// Bodies that fall, strike, slide, roll and rest: their motion in small steps, on contacts that have an identity.
//
// Time goes in windows of 2 ms. Bodies that can meet nothing within one fly through it in closed form. The others go through it in small
// steps. In each of them the velocities at its end follow from one complementarity problem over all points that touch (solver.hpp), begun
// at the impulses of the step before; places follow from the mean of both velocities, so that what neither slides nor strikes keeps its
// energy. A touch that comes fast is no part of that: its instant is found, the step ends there, and the impact is solved by itself.
// A group that a solution with zero velocity balances is put to sleep.
//
// Bodies on joints move in the coordinates that their joints leave (runtime/joints): flights, places and what impulses do come from there,
// all else is as for others. A cord is a contact that pulls.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "runtime/impact/impact.hpp"
#include "runtime/joints/mechanism.hpp"
#include "runtime/rigid/body.hpp"
#include "runtime/rigid/solver.hpp"

namespace carillon::rigid {

/// The end of the way of a hinge or a slider. Places and directions in the axes of the meshes, from the centres of mass, or in the world.
struct Stop {
  bool turns = true;          // a hinge; else a slider
  Vec3 at_a{}, at_b{};        // the joint
  Vec3 axis{};                // of b
  Vec3 lever_a{}, lever_b{};  // across the axis, alike at the start; of a hinge
  double arm_m = 0.0;         // of the lever at whose end the stop is; of a hinge
  double max = 0.0;           // rad or m from the start that a may turn or move against b; negative where is_lower
  bool is_lower = false;
};

/// A string without mass and stretch between two places, each in the axes of its body's mesh from the centre of mass, or in the world.
struct Cord {
  int a = 0, b = -1;  // bodies; b may be -1: the world
  Vec3 at_a{}, at_b{};
  double length_m = 0.0;
  double restitution = 0.0;    // when it comes taut
  std::optional<Stop> stop{};  // set: this is no cord but a stop of a joint, which pushes
};

/// What holds bodies together. Of a joint, `body` and `to` are bodies of the space, -1 or a fixed one: the world.
struct Links {
  std::vector<joints::Joint> joints;
  std::vector<Cord> cords;
};

/// The half space z <= height_m.
struct Ground {
  double height_m = 0.0;
  double restitution = 0.5, friction = 0.5;
  double young_modulus_pa = 0.0, poisson_ratio = 0.0;
};

struct Options {
  double step_s = 2.5e-4;   // the longest small step where a curved surface may touch; flat ones take twice as long ones
  double tolerance = 1e-5;  // of gravity times the step: when the sweeps over the contacts end
  int max_sweeps = 30;
  int max_direct = 3;                           // bodies of a group whose problem is factorised in every step
  bool islands = true;                          // false: all bodies in one problem, for comparison
  int max_settling = 200;                       // the same of a group that is about to rest
  double rolling_resistance = 1e-3;             // c: couple c R F against rolling, of hard on hard
  double joint_tolerance = joints::kTolerance;  // of a step of a mechanism's free motion [rad, m]
};

/// A touch that is followed.
struct Contact {
  shape::Touch touch;
  int a = 0, b = -1;  // bodies; -1: the ground
  int cord = -1;      // it is one: the gap is what it lacks to be taut, the normal points from a to b; or a stop
  bool touching = false;
  bool presses = false;      // in an impact that is on its way
  Vec3 impulse{}, couple{};  // of the last step, on a [N s, N m s]
  double step_s = 0.0;       // its length
  double until_s = 0.0;      // its end
  double lost_j = 0.0;       // by it, in that step
  bool rests = false;        // it did when a body of it fell asleep,
  Vec3 rest_n{};             // and gave a this force,
  bool is_load = false;      // which acts on whichever body is awake, and `impulse` is that and what it takes in addition
  std::array<std::int32_t, 2> triangles{-1, -1};  // of a and b, where it struck last
};

/// One point of an impact. Momentum and place in the world.
struct Hit {
  int a = 0, b = -1;
  shape::Touch touch;
  double approach_m_s = 0.0, restitution = 0.0;
  Vec3 impulse{};                                       // on a [N s]
  bool is_cord = false;                                 // comes taut
  double linked_mass_kg = 0.0;                          // that meets there, where bodies are on joints
  std::array<std::optional<shape::Place>, 2> places{};  // on a and b, where they were looked for
  std::array<std::int32_t, 2> triangles{-1, -1};        // on which they may be
};

/// An instant of impact: its points, and the bodies that it moved, before and after.
struct Strike {
  double time_s = 0.0;
  double together_s = 0.0;  // its points close within so much of that
  std::vector<Hit> hits;
  std::vector<int> bodies;
  std::vector<State> before, after;
  double modes_j = 0.0;  // given to modes
};

/// The force of one contact of an impact with modes, as impulses of equal steps; long ones come in pieces.
struct Forces {
  int a = 0, b = -1;
  shape::Place place_a, place_b;
  double time_s = 0.0, step_s = 0.0;
  bool continues = false;
  std::vector<Vec3> on_a, on_b;  // [N s], each in the frame of its body's mesh as it was then; on_b empty for the ground
};

/// Energies now, or lost since the beginning [J]: motion + modes + springs + lost is constant.
struct Books {
  double motion_j = 0.0;   // kinetic and of gravity
  double modes_j = 0.0;    // in the bodies' modes
  double springs_j = 0.0;  // of impacts that are on their way
  double lost_j = 0.0;     // by friction, in contacts, in the modes' damping, above their bands
};

struct Costs {
  std::int64_t steps = 0;       // small steps, and windows in which bodies only flew
  std::int64_t body_steps = 0;  // of each, the bodies that moved
  std::int64_t solves = 0, sweeps = 0, searches = 0, impacts = 0;
  std::int64_t flights = 0;  // of mechanisms: integrations of their free motion
};

class Groups;

/// All bodies of a simulation and their contacts. At the start of a window all bodies are at its time. What is fixed or asleep does not
/// move, bodies on joints never leave them, and the energies of calc_books() have a constant sum. Islands are stepped apart.
class Space {
 public:
  static constexpr double kWindow = 2e-3;  // s

  /// Bodies on joints must make trees (joints::make_mechanism), and their velocities are brought to what the joints allow.
  Space(std::vector<Solid> solids, std::vector<State> states, std::optional<Ground> ground, const Vec3& gravity, const Options& options,
        const Links& links = {});

  /// One small step of all that is not asleep, to at most `until_s`. At the start of a window all bodies are at its time; within it those
  /// that fly are at its end. Throws SolveError where a state is not finite.
  void step(double until_s);
  double get_time() const { return time_s_; }
  bool is_at_window() const { return at_window_; }

  const Solid& solid(int body) const { return solids_[static_cast<std::size_t>(body)]; }
  const State& state(int body) const { return states_[static_cast<std::size_t>(body)]; }
  const std::vector<State>& states() const { return states_; }
  /// Fixed or asleep.
  bool is_still(int body) const { return !moves(body); }
  bool is_all_asleep() const;
  /// Where all is asleep: to the end of the next window, without a step.
  void skip_window(double end_s);
  /// Of the point of a body that is there [m/s]; the ground and what is fixed have none.
  Vec3 calc_velocity(int body, const Vec3& where) const;
  const Vec3& get_spin(int body) const { return placed_[static_cast<std::size_t>(body)].spin; }
  /// Contacts of bodies that are awake.
  void list_contacts(std::vector<const Contact*>& out) const;
  /// Impacts since the last call.
  std::vector<Strike> take_strikes() { return std::exchange(strikes_, {}); }
  /// Forces of impacts with modes since the last call.
  std::vector<Forces> take_forces() { return std::exchange(forces_, {}); }
  Books calc_books() const;
  /// How long a contact lasts (calc_hertz_duration) in which so much mass meets at that speed.
  double calc_contact_time(const Hit& hit, double mass_kg, double speed_m_s) const;
  int count_mechanisms() const { return static_cast<int>(linked_.size()); }
  /// How far the velocity asked for at the start is from what the joints of a body allow [m/s]; 0 without.
  double get_start_error(int body) const;
  /// Does a joint hold the two together, so that they do not collide?
  bool is_joined(int a, int b) const { return joined_.contains(std::minmax(a, b)); }
  /// Groups of moving bodies that may touch each other in the present window.
  int count_islands() const { return islands_; }
  const Costs& get_costs() const { return costs_; }
  const std::optional<Ground>& ground() const { return ground_; }
  const Vec3& gravity() const { return gravity_; }

 private:
  struct Pair {
    int a = 0, b = -1;
    shape::PairMemory memory;
    std::vector<Contact> contacts;
    double margin_m = 0.0, travelled_m = 0.0;  // since the last search
    bool searched = false;
    std::int64_t window = -1;  // in which it was last near
    int cord = -1;             // it is one
    bool touches() const {
      return std::any_of(contacts.begin(), contacts.end(), [](const Contact& c) { return c.touching; });
    }
    bool has_closed_gap() const;  // within kDeep, with or without a force
    double sag_m = 0.0;           // so deep an impact with modes left it: what it rests on has given way, and need not bring it up
  };
  /// Bodies on joints. What of it is of a step stands below the line.
  struct Linked {
    std::unique_ptr<joints::Mechanism> mechanism;
    std::vector<int> bodies;  // its members
    bool hangs = false;       // from something that does not move
    joints::Coordinates now, flew_from;
    int ringing = -1;  // member that an impact with modes moves
    // ------------
    joints::Coordinates free;  // at the end of the step without contacts
    std::vector<double> push;  // change of its velocities by the contacts; empty: none
    Linkage linkage;
  };
  struct Island {
    std::vector<int> bodies;
    std::vector<Pair*> pairs;
    int stride = 1;  // small steps that it takes at once
  };
  /// What a body's group has done lately, and what it may try.
  struct Pace {
    double slow_s = 0.0;           // it has been slow for so long
    double crowded_until_s = 0.0;  // its impacts come all at once until then
    double next_proof_s = 0.0;     // when rest may be looked for again,
    double next_part_s = 0.0;      // that of a part of its group
    double next_guess_s = 0.0;     // when factorisation may be tried again
  };
  /// A contact by its place in a pair.
  struct Ref {
    Pair* pair = nullptr;
    std::size_t contact = 0;
    Contact& get() const { return pair->contacts[contact]; }
    bool operator==(const Ref&) const = default;
  };

  /// The modal state of a body at a time.
  struct Ring {
    std::vector<double> q, q_dot;
    double time_s = 0.0;
  };
  /// A contact of an impact with modes.
  struct Press {
    int a = 0, b = -1;
    shape::Place place_a, place_b;
    std::vector<double> shape_a, shape_b;  // axes of the meshes; empty: does not ring
    Vec3 station{};                        // of the point, from the centre of the one that moves, axes of its mesh
    Forces waiting;                        // what was not handed out yet
  };
  /// An impact with modes, on its way.
  struct Ringing {
    std::unique_ptr<impact::Impact> impact;
    double start_s = 0.0;
    std::vector<int> bodies;  // in the order of the impact's
    std::vector<Press> presses;
  };

  // space.cpp: windows, pairs, groups
  void open_window(double end_s);
  void choose_steps(double length_s);
  void join_sleeping(Groups& groups) const;
  void add_pair(int a, int b);
  void sort_near();
  void search(Pair& pair, double step_s);
  void refresh(Pair& pair);
  void update(Pair& pair, double step_s);
  std::vector<Island> make_islands();
  void place_body(int body);
  void check_finite(int body) const;
  std::vector<int> wake(int body, int by, bool alone = false);
  void reach_out(int body);
  void call_back(int body, int by);
  double find_time(int step) const;
  double calc_pair_friction(int a, int b) const;
  double calc_pair_restitution(int a, int b) const;
  double calc_pair_speed(int a, int b) const;
  double calc_pair_size(int a, int b) const;
  double calc_pair_thickness(int a, int b) const;
  double calc_approach(const Contact& contact) const;
  shape::Box calc_box(int body, double grown_m) const;

  // linked.cpp: bodies on joints
  void link(const Links& links);
  Linked* find_linked(int body) {
    return body >= 0 && !linked_.empty() && linked_of_[static_cast<std::size_t>(body)] >= 0
               ? &linked_[static_cast<std::size_t>(linked_of_[static_cast<std::size_t>(body)])]
               : nullptr;
  }
  /// Are they one body, or on the same joints?
  bool hang_together(int a, int b) const {
    return a == b || (a >= 0 && b >= 0 && find_linked(a) != nullptr && find_linked(a) == find_linked(b));
  }
  const Linked* find_linked(int body) const { return const_cast<Space*>(this)->find_linked(body); }
  int get_member(int body) const { return member_[static_cast<std::size_t>(body)]; }
  joints::Coordinates fly_linked(const Linked& linked, const joints::Coordinates& from, double time_s) const;
  void place_linked(const Linked& linked);
  static State make_state(const Solid& solid, const joints::Motion& motion);
  void activate_linked(std::vector<char>& active) const;
  void fly_windows_of_linked(const std::vector<char>& active, double length_s);
  double calc_linked_pull(const Linked& linked) const;
  bool is_in_balance(const Linked& linked) const;
  void predict_linked(Linked& linked, double h, bool at_rest);
  void push_linked(const Island& island);
  joints::Coordinates calc_linked_moved(const Linked& linked, double part_s, double step_s) const;
  void give_linked(Linked& linked, const std::vector<joints::Spatial>& impulses);
  void stop_linked(const Island& island);
  void advance_linked_ringing(Linked& linked, const impact::Body& struck, double time_s, double step_s);
  impact::Mobility calc_own_mobility(const Linked& linked, int member) const;
  template <typename Do>
  void for_linked(const Island& island, Do&& act) {
    if (linked_.empty()) return;
    for (const int body : island.bodies)
      if (Linked* linked = find_linked(body); linked != nullptr && linked->bodies.front() == body) act(*linked);
  }

  // cords.cpp: cords as contacts that only pull
  Vec3 calc_anchor(const Cord& cord, bool is_a, const State& state) const;
  Point make_stop_point(const Contact& contact, double h) const;
  void stretch(Pair& pair) const;
  double calc_cord_gap(const Cord& cord, const State& a, const State& b) const;
  void add_cord(Pair& pair);
  void open_cords(std::vector<char>& active, double length_s);

  // step.cpp: one group through one small step
  void step_island(Island& island, double start_s, double step_s);
  void note_crowd(const Island& island, double time_s);
  void strike_at_once(Island& island, double start_s, double step_s);
  void predict(const Island& island, double h, bool at_rest);
  Point make_point(const Contact& contact) const;
  void make_points(Island& island, double h, bool leaves_impacts);
  void sort_points();
  double calc_patch_radius(const Contact& contact) const;
  Vec3 calc_travelled(Pair& pair, shape::Touch touch) const;
  Point make_lasting_point(Pair& pair, const Contact& contact, double h) const;
  Point make_cord_point(const Contact& contact, double h) const;
  void solve(double tolerance_m_s);
  void sum_turned();
  State calc_moved(std::size_t n, double part_s, double step_s) const;
  double calc_loss(const Point& point, double part) const;
  void keep_impulses(double at_s, double h);
  void move_bodies(const Island& island, double to_s, double part_s, double h, double before_j);
  double calc_energy(const Island& island) const;
  void take_gain(const Island& island, double before_j);

  // rest.cpp: what sleeps, and until when
  bool may_rest(const Island& island, double h);
  bool is_balanced(Island& island, double h, const std::vector<joints::Spatial>& pulls, double slow_s);
  enum class Rest { none, stands, leans };  // leans: only with the forces of others
  Rest rest(Island& island, double h, const std::vector<joints::Spatial>& pulls = {});
  void add_loads(const Island& island, double h);
  double calc_load_work(std::size_t n, const State& to, double part_s, double step_s) const;
  static bool is_close(const Pair& pair);
  void rest_apart();
  void add_pull(const Contact& contact, bool is_a, const Vec3& force_n, joints::Spatial& pull) const;
  void watch(Pair& pair, double step_s);
  void wake_unbalanced();
  bool wake_struck(Island& island, const std::vector<Ref>& taken);

  // strike.cpp: impacts
  double calc_compliance(int a, int b) const;
  double calc_contact_radius(const shape::Touch& touch, int a, int b) const;
  bool is_fast(const Contact& contact, double h) const;
  bool find_impact(const Island& island, double h, double& at_s, std::vector<Ref>& first);
  std::optional<double> find_instant(const Ref& ref, double apex_s, double guess_s, double h);
  bool confirm_impact(std::vector<Ref>& first, double step_s, double near_m);
  std::vector<Ref> gather_points(const Island& island, const std::vector<Ref>& first) const;
  Hit make_hit(const Contact& contact, Point& point) const;
  double calc_conserving_part(const std::vector<Mover>& before, const std::vector<Point>& points) const;
  double give_impulses(Strike& record, const std::vector<Point>& points);
  void strike(Island& island, const std::vector<Ref>& first, double time_s);
  void give_to_modes(Strike& record, double taken_j);

  // ringing.cpp: impacts with modes
  bool predict_hits(const std::vector<Ref>& taken, std::vector<Hit>& hits, std::vector<Point>& points);
  bool begin_ringing(const std::vector<Ref>& taken, std::vector<Hit>& hits, double time_s);
  bool add_resting(const std::vector<Ref>& taken, const std::vector<Hit>& hits, double time_s, std::vector<std::size_t>& order) const;
  void release_what_rests(const Island& island);
  void advance_ringings(const Island& island, double to_s, double part_s, double step_s);
  void take_pull_back(int body, const joints::Spatial& pull, double time_s, double step_s);
  void keep_pulses(Ringing& ringing);
  void hand_out_forces(Press& press);
  void release(Ringing& ringing, double time_s);
  void end_ringing(Ringing& ringing, double time_s);
  Ring& ring_until(int body, double time_s);
  impact::Body make_struck(int body, double time_s);
  void put_on_joints(int body, impact::Body& b) const;
  impact::Spring make_spring(const shape::Touch& touch, int a, int b) const;
  const shape::Place& find_place(Hit& hit, bool is_a) const;
  std::vector<double> find_shape(int body, const std::vector<double>& shape) const;
  Ringing* find_ringing(int body);
  Ringing* find_own_ringing(const Hit& hit);
  bool is_resting(const Contact& contact) const;
  bool is_pressed(const Pair& pair, const Vec3& where) const;

  /// Does an impact with modes move this body at present, or one on the same joints?
  bool has_impact(int body) const {
    if (!moves(body)) return false;
    const Linked* linked = find_linked(body);
    return linked != nullptr ? linked->ringing >= 0 : in_ringing_[static_cast<std::size_t>(body)] != 0;
  }
  bool rings(int body) const { return body >= 0 && solids_[static_cast<std::size_t>(body)].modes != nullptr; }
  /// -1 is the ground: fixed.
  bool is_fixed(int body) const { return body < 0 || solids_[static_cast<std::size_t>(body)].fixed; }
  bool moves(int body) const { return !is_fixed(body) && !asleep_[static_cast<std::size_t>(body)]; }
  /// Does a step of it begin now?
  bool is_due(int body) const { return step_in_window_ % stride_[static_cast<std::size_t>(body)] == 0; }
  /// Has it no curved surface?
  bool is_flat(int body) const { return body < 0 || solid(body).shape->is_polyhedron(); }
  /// In the group that is being stepped; -1: does not move.
  int find_index(int body) const { return moves(body) ? index_[static_cast<std::size_t>(body)] : -1; }
  const shape::Shape* get_shape(int body) const { return body >= 0 ? solid(body).shape.get() : nullptr; }
  /// Are both bodies of a pair, as far as they move, in the group that is being stepped? A touch that was found in this step waits for the
  /// next.
  bool is_stepped(const Pair& pair) const {
    const auto is_in = [this](int body) { return !moves(body) || index_[static_cast<std::size_t>(body)] >= 0; };
    return is_in(pair.a) && is_in(pair.b);
  }

  std::vector<Solid> solids_;
  std::vector<State> states_;
  std::vector<Linked> linked_;
  std::vector<int> linked_of_, member_;   // of each body; empty without joints
  std::set<std::pair<int, int>> joined_;  // pairs that do not collide
  std::vector<Cord> cords_;
  std::vector<Pair> cord_pairs_;  // one a cord
  std::vector<Placed> placed_;
  std::vector<char> asleep_, flying_, in_ringing_;
  std::vector<int> stride_;  // small steps of the window that a body takes at once
  std::vector<Pace> paces_;
  std::vector<double> reach_m_s_;
  std::vector<State> flew_from_;
  std::optional<Ground> ground_;
  Vec3 gravity_{};
  Options options_;
  std::map<std::pair<int, int>, Pair> pairs_;
  std::vector<Pair*> near_;  // of this window, in order
  std::vector<Strike> strikes_;
  std::vector<Ring> rings_;
  std::list<Ringing> ringings_;
  std::vector<Forces> forces_;
  double lost_j_ = 0.0;
  double time_s_ = 0.0, window_end_s_ = 0.0, window_start_s_ = 0.0;
  std::int64_t window_ = 0;
  int islands_ = 0, step_in_window_ = 0, steps_in_window_ = 1;
  bool at_window_ = true, any_active_ = false, near_is_sorted_ = true;
  Costs costs_;
  Solver solver_;
  // Of the step that is being made:
  double together_s_ = 0.0;                    // touches nearer in time than this are one impact
  std::vector<int> index_;                     // of a body in its island
  const std::vector<int>* stepped_ = nullptr;  // its bodies
  std::vector<Mover> movers_;
  std::vector<Vec3> free_spin_;
  std::vector<State> free_state_;  // at the end of the step without contacts
  std::vector<Placed> free_;
  std::vector<Vec3> free_centre_, free_velocity_;  // of those on joints
  std::vector<Point> points_;
  std::vector<Vec3> turned_;            // angular impulses on them
  std::vector<joints::Spatial> loads_;  // impulses of what sleeps on them
  std::vector<Ref> rows_;               // of points_
  std::vector<std::size_t> order_;
  std::vector<shape::Touch> touches_;
};

/// Hertz contact time [s]: 2.87 (m^2 / (R E*^2 v))^(1/5) (K. L. Johnson, "Contact mechanics" (1985), eq. 11.24), kept within 5 us .. 20 ms.
double calc_hertz_duration(double compliance_per_pa, double radius_m, double mass_kg, double speed_m_s);

}  // namespace carillon::rigid
