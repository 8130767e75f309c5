// Impacts that involve modes.
#pragma once

#include <list>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "runtime/physics/impact/impact.hpp"
#include "runtime/physics/rigid/instants.hpp"
#include "runtime/physics/rigid/modal_states.hpp"
#include "runtime/physics/rigid/rigid_impact.hpp"
#include "runtime/physics/rigid/step.hpp"

namespace carillon::rigid {

/// A contact of a modal impact.
struct ModalContact {
  Forces forces;                         // bodies, positions, and unreported impulses
  impact::Spring spring;                 // of this point alone
  std::vector<double> shape_a, shape_b;  // mesh axes; empty: no modes
  Vec3 station{};                        // of the point, from the centre of the moving body, mesh axes
  std::uint64_t touch = 0;               // id of its touch
  bool is_sharp = false;                 // a corner: shares the face's spring with others
  bool is_followed = false;              // in the current touch set,
  Vec3 normal{};                         // with this normal to side a
  double gap_m = 0.0;                    // and this gap of the rigid surfaces

  bool is_between(int a, int b) const { return (forces.a == a && forces.b == b) || (forces.a == b && forces.b == a); }
};

/// A modal impact in progress.
struct ModalImpact {
  std::unique_ptr<impact::Impact> impact;
  double start_s = 0.0;
  std::vector<int> bodies;  // in the order of `impact`
  std::vector<ModalContact> contacts;
  int rolled = 0;           // slow pulses in a row that ended because their contact moved to another place
  double retained_j = 0.0;  // of its losses, for the recovery of its contacts against gravity
  double lost_j = 0.0;      // in contacts and modes, at the last update of retained_j
};

/// Impacts integrated with the modes of their bodies (runtime/physics/impact) over as many small steps as needed. They determine the motion
/// of their bodies; gravity and other contacts enter as accelerations, constant per small step. Invariant: a body, and its modal state,
/// belongs to at most one impact.
class ModalImpacts {
 public:
  ModalImpacts(Bodies& bodies, ModalStates& states, Ledger& ledger) : bodies_(bodies), states_(states), ledger_(ledger) {}

  const std::list<ModalImpact>& list() const { return impacts_; }
  /// True if the two bodies of a pair are in an impact at that point. Touch ids change while bodies roll.
  bool is_pressed(const Pair& pair, const Vec3& where) const;

  /// False: no modal impact begins; impacts are rigid, their restitution reduced by the energy that modes would take.
  void allow(bool may_begin) { may_begin_ = may_begin; }
  /// Limits the restitution of every hit by the energy transferred to modes; true if the impact must be integrated. Hits that would bend
  /// a body far are rigid.
  bool predict(const Step& step, Collision& collision);
  /// Begins an impact, or adds the hits to a current one. False if there are too many points: use the rigid impact.
  bool begin(const Step& step, Collision& collision, const Instants& instants, TouchSets& touches);
  /// A rigid impact ends the modal impacts of its bodies.
  void end(const std::vector<Hit>& hits, TouchSets& touches);
  /// Ends the modal impact of a body.
  void end(int body, TouchSets& touches) {
    if (ModalImpact* modal = find(body); modal != nullptr) end(*modal, touches);
  }
  /// Ends impacts with slow touches elsewhere, or touches deeper than their springs and modes explain, at the time of the touches.
  void end_where_touching(const Step& step, TouchSets& touches);
  /// Moves contacts of impacts to their touches; touches that may close within a step become open contacts.
  void follow(const Step& step, double length_s, TouchSets& touches);
  /// Begins impacts of ringing bodies before contact of their deformed surfaces in a step; true if there were any.
  bool begin_early(const Step& step, double length_s, const Instants& instants);
  /// Length of the next part of a step with this rest [s], short where surfaces yield or swing far.
  double limit_part(const Step& step, double length_s) const;
  /// True if a body moved by an impact may meet a body outside of it within a step.
  bool may_meet_others(const Step& step, double length_s, TouchSets& touches);
  /// Depth of a pair explained by springs and modes of its impact [m].
  double calc_depth(const Pair& pair) const;
  /// The same at a point of the pair [m].
  double calc_depth(const Pair& pair, const Vec3& where) const;
  /// Advances the impacts of an island to the time `to_s`, `part_s` later, with the effect of gravity and other contacts from the step.
  /// Forces are reported at the end of the window.
  void advance(const Step& step, double to_s, double part_s, double window_end_s, TouchSets& touches);
  /// Returns the forces since the last call.
  std::vector<Forces> take_forces() { return std::exchange(forces_, {}); }
  /// Adds the energies and losses of modes and springs in impacts.
  void add_to(Books& books) const;

 private:
  /// Hits and resting contacts of a collision that become contacts of an impact.
  struct Selection {
    std::vector<int> order;
    std::vector<char> rests;  // per contact of the collision
  };

  /// Bodies and contacts of a new impact.
  struct Made {
    std::vector<impact::Body> bodies;
    std::vector<impact::Contact> springs;
    std::list<std::vector<double>> shapes;  // of the contacts
  };

  /// True if contacts of a body can belong to an impact, as it does itself or has neither motion nor modes.
  bool may_join(bool is_in, int body) const { return is_in || (!bodies_.moves(body) && !bodies_.has_modes(body)); }
  ModalImpact* find(int body);
  ModalImpact* find_own(const Step& step, const Hit& hit);
  std::optional<Selection> select(const Step& step, const Collision& collision, const Instants& instants);
  enum class End { none, rolls, lasts };
  static End find_end(const ModalImpact& modal, double time_s);
  void follow(ModalImpact& modal, Pair& pair, double way_m, double length_s, TouchSets& touches);
  void part(Pair& pair, const TouchSets& touches) const;
  ModalContact* find_nearest(ModalImpact& modal, const Contact& touch, bool is_near) const;
  bool place(ModalImpact& modal, int k, Contact& touch, const geometry::Touch& at);
  std::vector<impact::Spring> find_springs(const ModalImpact& modal, double part_s) const;
  std::vector<impact::Contact> place_springs(const ModalImpact& modal, const std::vector<impact::Body>& bodies, double part_s,
                                             std::list<std::vector<double>>& shapes) const;
  static double calc_yield(const impact::Contact& contact, const std::vector<impact::Body>& bodies);
  bool add_resting(const Collision& collision, const Instants& instants, std::vector<int>& order) const;
  bool shares_articulations(const std::vector<Hit>& hits, const std::vector<int>& order) const;
  bool join(const std::vector<Hit>& hits, Selection& selection, TouchSets& touches, ModalImpact*& joined);
  bool bends_far(int body, const std::vector<double>& phi, double mass_kg, double speed_m_s);
  double calc_swing(const Contact& touch, double approach_m_s);
  bool may_begin_early(const Step& step, const Pair& pair, const Instants& instants) const;
  double fly_to_modes(const std::vector<Hit>& hits, const std::vector<int>& order);
  int add_body(ModalImpact& modal, int body, std::vector<impact::Body>& made);
  void add_contact(ModalImpact& modal, Contact& touch, double sag_m, Hit& hit, bool rests, Made& made);
  impact::Body make_body(int body);
  void set_motion(int body, impact::Body& made) const;
  std::vector<double> turn_to_world(int body, const std::vector<double>& shape) const;
  Vec3 find_station(int a, int b, const geometry::Touch& touch) const;
  Vec3 find_station(const ModalContact& contact) const;
  template <typename Do>
  void for_contacts(const Pair& pair, Do&& act) const;
  void move_articulation(const ArticulationStep& step, const impact::Body& struck, double time_s, double step_s);
  void give_pull(const Step& step, int n, const Vec3& moved, const Vec3& turned);
  void undo_pull(const Step& step, int body, const joints::Spatial& pull, double time_s);
  void keep_pulses(ModalImpact& modal);
  void report(ModalContact& contact);
  double retain(ModalImpact& modal) const;
  void release(ModalImpact& modal, double time_s, TouchSets& touches);
  void end(ModalImpact& modal, TouchSets& touches);

  Bodies& bodies_;
  ModalStates& states_;
  Ledger& ledger_;
  std::list<ModalImpact> impacts_;
  bool may_begin_ = true;
  std::vector<Forces> forces_;
};

}  // namespace carillon::rigid
