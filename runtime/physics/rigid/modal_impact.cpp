// Method: an impact with ringing bodies is integrated with their modes, one small step at a time, until its contacts have separated.
// Source: runtime/physics/impact/impact.hpp; docs/decisions/impact.md.
#include "runtime/physics/rigid/modal_impact.hpp"

#include <algorithm>
#include <cmath>

#include "runtime/physics/impact/face.hpp"
#include "runtime/physics/rigid/limits.hpp"

namespace carillon::rigid {
namespace {

constexpr double kMaxSlowImpactS = 50e-3;     // s; end of slow impacts, which become resting contacts,
constexpr double kMaxImpactS = 0.5;           // s; and of all others
constexpr double kMaxCorrectionRatio = 0.01;  // fraction of the kinetic energy: maximum correction per step of an impact on joints
constexpr double kSamePlaceRatio = 0.05;      // of the size
constexpr double kMinMoveRatio = 0.02;        // fraction of the size: minimum distance of a contact from its touch for an update,
constexpr double kYieldedM = 1e-4;            // m; where it yields more,
constexpr double kMinYieldedRatio = 0.005;    // a smaller one: its modes yield differently a short way off
constexpr int kMaxFollowed = 12;              // contacts per impact, including open ones
constexpr double kExplainedRatio = 1.3;       // permitted ratio of the depth to that of spring and modes
constexpr int kMaxRolled = 8;                 // slow pulses in a row, each at another place: the impact has become rolling
constexpr double kFarYieldedM = 1e-3;         // m; where surfaces yield or swing more, contacts are followed
constexpr double kMaxPartM = 5e-5;            // m; after every such way of a surface,
constexpr double kMinPartS = 2e-5;            // s; but not more often
constexpr double kRoundingRatio = 1e-12;      // of velocities
constexpr double kQuietAfterImpactS = 5e-3;   // s; after the end of an impact, without slow impacts of the pair

/// Gives the nth body of an impact, now `b`, the velocities of its rigid body: a projection changes them to keep the momentum of an island.
void push(impact::Impact& impact, int n, const impact::Body& b, const Vec3& velocity, const Vec3& spin) {
  if (!(b.mass_kg > 0.0) || b.on_joints) return;
  const Vec3 change = velocity - b.velocity_m_s, spin_change = spin - b.spin_rad_s;
  if (norm(change) > kRoundingRatio * norm(b.velocity_m_s) || norm(spin_change) > kRoundingRatio * norm(b.spin_rad_s))
    impact.push(n, change, spin_change);
}

/// Greatest depth explained at a contact [m].
double calc_deepest(const ModalImpact& modal) {
  double deepest_m = 0.0;
  for (int k = 0; k < static_cast<int>(modal.contacts.size()); ++k) deepest_m = std::max(deepest_m, modal.impact->calc_depth(k));
  return deepest_m;
}

/// Angular momentum of a body after a part of an impact, which turned it with the inertia and the gyroscopic couple of its start: their
/// work is taken back from the spin. `pull`: angular acceleration by other forces.
Vec3 calc_momentum(const Solid& solid, const Quaternion& turned, const impact::Body& b, const Vec3& pull_rad_s2) {
  const Mat3 rotation = make_rotation(turned);
  const Vec3 momentum = rotation * (solid.inertia_kg_m2 * (transpose(rotation) * b.spin_rad_s)),
             gyroscopic_n_m = b.inertia_kg_m2 * (b.spin_acceleration_rad_s2 - pull_rad_s2);
  const double turning_j = 0.5 * dot(b.spin_rad_s, momentum),
               wanted_j = 0.5 * dot(b.spin_rad_s, b.inertia_kg_m2 * b.spin_rad_s) - dot(gyroscopic_n_m, b.turned_rad);
  return turning_j > 0.0 && wanted_j > 0.0 ? std::sqrt(wanted_j / turning_j) * momentum : momentum;
}

double calc_lost(const impact::Books& books) { return books.dissipated_modes + books.dissipated_contact; }

bool has_bodies_of(const Step& step, const ModalImpact& modal) {
  return std::any_of(modal.bodies.begin(), modal.bodies.end(), [&](int body) { return step.find(body) >= 0; });
}

bool has_contact(const ModalImpact& modal, const Pair& pair) {
  return std::any_of(modal.contacts.begin(), modal.contacts.end(), [&](const ModalContact& c) { return c.is_between(pair.a, pair.b); });
}

}  // namespace

ModalImpact* ModalImpacts::find(int body) {
  if (const Articulation* articulation = bodies_.find_articulation(body); articulation != nullptr && articulation->struck >= 0)
    body = articulation->bodies[articulation->struck];
  if (!bodies_.is_in_impact(body)) return nullptr;
  for (ModalImpact& modal : impacts_)
    if (std::find(modal.bodies.begin(), modal.bodies.end(), body) != modal.bodies.end()) return &modal;
  return nullptr;
}

/// Position of a touch on the moving body, from its centre, mesh axes.
Vec3 ModalImpacts::find_station(int a, int b, const geometry::Touch& touch) const {
  return bodies_.moves(a) ? touch.station_a - bodies_.solid(a).centre_m : touch.station_b - bodies_.solid(b).centre_m;
}

/// Current position of a contact, by the moving body.
Vec3 ModalImpacts::find_station(const ModalContact& contact) const {
  const int body = bodies_.moves(contact.forces.a) ? contact.forces.a : contact.forces.b;
  return bodies_.state(body).centre + bodies_.placed(body).rotation * contact.station;
}

/// Calls act(impact, index) for all contacts between the bodies of a pair.
template <typename Do>
void ModalImpacts::for_contacts(const Pair& pair, Do&& act) const {
  for (const ModalImpact& modal : impacts_)
    for (int k = 0; const ModalContact& contact : modal.contacts) {
      if (contact.is_between(pair.a, pair.b)) act(modal, k);
      ++k;
    }
}

bool ModalImpacts::is_pressed(const Pair& pair, const Vec3& where) const {
  const double near = kSamePlaceRatio * bodies_.calc_size(pair.a, pair.b);
  bool any = false;
  for_contacts(pair, [&](const ModalImpact& modal, int k) { any = any || norm(find_station(modal.contacts[k]) - where) < near; });
  return any;
}

double ModalImpacts::calc_depth(const Pair& pair) const {
  double depth = 0.0;
  for_contacts(pair, [&](const ModalImpact& modal, int k) { depth = std::max(depth, modal.impact->calc_depth(k)); });
  return depth;
}

double ModalImpacts::calc_depth(const Pair& pair, const Vec3& where) const {
  const double near = kSamePlaceRatio * bodies_.calc_size(pair.a, pair.b);
  double depth = 0.0;
  for_contacts(pair, [&](const ModalImpact& modal, int k) {
    if (norm(find_station(modal.contacts[k]) - where) < near) depth = std::max(depth, modal.impact->calc_depth(k));
  });
  return depth;
}

/// Copies the motion of a body into an impact.
void ModalImpacts::set_motion(int body, impact::Body& b) const {
  const State& state = bodies_.state(body);
  const Placed& placed = bodies_.placed(body);
  b.centre_m = state.centre;
  b.inertia_kg_m2 = bodies_.calc_inertia(body);
  b.acceleration_m_s2 = bodies_.gravity();
  b.spin_acceleration_rad_s2 = placed.inverse_inertia * cross(state.momentum, placed.spin);
  const Articulation* articulation = bodies_.find_articulation(body);
  if (articulation == nullptr) return;
  const int member = bodies_.get_member(body);
  std::vector<joints::Spatial> rates;
  articulation->mechanism->find_accelerations(articulation->now, rates);
  b.on_joints = true;
  b.mobility = bodies_.calc_own_mobility(*articulation, member);
  b.velocity_m_s = state.velocity;
  b.spin_rad_s = placed.spin;
  b.acceleration_m_s2 = rates[member].linear;
  b.spin_acceleration_rad_s2 = rates[member].angular;
}

/// Mode shapes of a body, rotated to world axes.
std::vector<double> ModalImpacts::turn_to_world(int body, const std::vector<double>& shape) const {
  const int size = static_cast<int>(shape.size());
  std::vector<double> world(size);
  const Mat3& r = bodies_.placed(body).rotation;
  for (int m = 0; m + 2 < size; m += 3) {
    const Vec3 v = r * Vec3{shape[m], shape[m + 1], shape[m + 2]};
    world[m] = v[0];
    world[m + 1] = v[1];
    world[m + 2] = v[2];
  }
  return world;
}

void ModalImpacts::end(const std::vector<Hit>& hits, TouchSets& touches) {
  for (const Hit& hit : hits)
    for (const int body : {hit.a, hit.b})
      if (bodies_.is_moved_by_impact(body)) end(*find(body), touches);
}

void ModalImpacts::end_where_touching(const Step& step, TouchSets& touches) {
  if (impacts_.empty()) return;
  for (Pair* pair : step.island().pairs)
    for (const int body : {pair->a, pair->b}) {
      ModalImpact* modal = bodies_.moves(body) ? find(body) : nullptr;
      if (modal == nullptr || pair->cord >= 0) continue;
      bool is_deep = false, is_resting = false;
      for (const Contact& c : pair->contacts) {
        const double depth = -c.touch.gap_m - pair->sag_m - kMaxDepthM;
        is_deep = is_deep || (depth > 0.0 && depth > kExplainedRatio * calc_depth(*pair, c.touch.where_m));
        is_resting = is_resting || (c.carries() && std::abs(bodies_.calc_approach(c.touch, c.a, c.b)) <= kMinImpactSpeedMS);
      }
      if (is_deep) pair->quiet_until(bodies_.get_time() + kQuietAfterImpactS);
      if (is_deep || is_resting) end(*modal, touches);
    }
}

/// Moves a contact to its touch; true if a pulse ends because the touch is at another place.
bool ModalImpacts::place(ModalImpact& modal, int k, Contact& touch, const geometry::Touch& at) {
  ModalContact& contact = modal.contacts[k];
  Forces& forces = contact.forces;
  const bool is_swapped = forces.a != touch.a;
  contact.touch = touch.touch.id;
  contact.is_followed = true;
  contact.is_sharp = !at.smooth;
  contact.normal = (is_swapped ? -1.0 : 1.0) * at.normal;
  contact.gap_m = at.gap_m;
  touch.press();
  const Vec3 station = find_station(touch.a, touch.b, at);
  const double moved_ratio = norm(contact.station - station) / bodies_.calc_size(touch.a, touch.b);
  if (moved_ratio < (modal.impact->calc_depth(k) > kYieldedM ? kMinYieldedRatio : kMinMoveRatio)) return false;
  const bool has_pulse = moved_ratio >= kMinMoveRatio && (forces.continues || !forces.on_a.empty());
  report(contact);
  forces.continues = false;
  forces.moves = modal.impact->get_compression(k) > 0.0;
  Hit hit{.a = touch.a, .b = touch.b, .touch = at, .triangles = touch.triangles};
  contact.station = station;
  for (const bool is_a : {true, false}) {
    if ((is_a ? touch.a : touch.b) < 0) continue;
    const bool is_first = is_a != is_swapped;
    (is_first ? forces.place_a : forces.place_b) = find_place(bodies_, hit, is_a);
    if (bodies_.has_modes(is_a ? touch.a : touch.b)) (is_first ? contact.shape_a : contact.shape_b) = find_shape(bodies_, hit, is_a);
  }
  return has_pulse;
}

/// Contact for a touch with a new id: the nearest at its position, or an open one for a touch that may close.
ModalContact* ModalImpacts::find_nearest(ModalImpact& modal, const Contact& touch, bool is_near) const {
  ModalContact* nearest = nullptr;
  double least_m = kSamePlaceRatio * bodies_.calc_size(touch.a, touch.b);
  for (int n = 0; ModalContact & contact : modal.contacts) {
    const bool is_open = !(modal.impact->get_compression(n++) > 0.0);
    if (contact.is_followed || !contact.is_between(touch.a, touch.b)) continue;
    const double away_m = norm(find_station(contact) - touch.touch.where_m);
    if (away_m >= least_m && !(is_near && is_open && nearest == nullptr)) continue;
    nearest = &contact;
    least_m = std::min(least_m, away_m);
  }
  return nearest;
}

/// Springs of an impact for a part of this length.
std::vector<impact::Spring> ModalImpacts::find_springs(const ModalImpact& modal, double part_s) const {
  std::vector<impact::FaceCorner> corners;
  for (const ModalContact& contact : modal.contacts) {
    const int a = contact.forces.a, b = contact.forces.b;
    corners.push_back({.alone = contact.spring,
                       .is_sharp = contact.is_sharp && contact.is_followed,
                       .where_m = find_station(contact),
                       .normal = contact.normal,
                       .size_m = bodies_.calc_size(a, b),
                       .compliance_per_pa = bodies_.calc_compliance(a, b)});
  }
  return impact::find_springs(*modal.impact, corners, kMaxDepthM, part_s);
}

void ModalImpacts::follow(ModalImpact& modal, Pair& pair, double way_m, double length_s, TouchSets& touches) {
  const double reach_m = 2.0 * way_m + bodies_.get_swing(pair.a) + bodies_.get_swing(pair.b) + kMaxDepthM;
  const auto follow_touch = [&](ModalContact& contact, Contact& c) {
    const int k = static_cast<int>(&contact - modal.contacts.data());
    if (!place(modal, k, c, touches.find_closing(pair, c, length_s))) return;
    modal.rolled = std::abs(modal.impact->calc_approach(k)) < kRattleSpeedMS ? modal.rolled + 1 : 0;
  };
  std::vector<Contact*> others;
  for (Contact& c : pair.contacts) {
    const auto same = std::find_if(modal.contacts.begin(), modal.contacts.end(), [&](const ModalContact& contact) {
      return !contact.is_followed && contact.is_between(pair.a, pair.b) && contact.touch == c.touch.id;
    });
    if (same != modal.contacts.end())
      follow_touch(*same, c);
    else
      others.push_back(&c);
  }
  for (Contact* c : others) {
    const bool is_near = c->touch.gap_m < reach_m;
    if (ModalContact* nearest = find_nearest(modal, *c, is_near); nearest != nullptr) {
      follow_touch(*nearest, *c);
    } else if (is_near && modal.contacts.size() < kMaxFollowed) {
      Hit hit{.a = c->a, .b = c->b, .touch = touches.find_closing(pair, *c, length_s), .triangles = c->triangles};
      Made made;
      add_contact(modal, *c, pair.sag_m, hit, false, made);
      place(modal, static_cast<int>(modal.contacts.size()) - 1, *c, hit.touch);
    }
  }
}

void ModalImpacts::part(Pair& pair, const TouchSets& touches) const {
  double deepest_m = 0.0;
  Vec3 normal{};
  for_contacts(pair, [&](const ModalImpact& modal, int k) {
    const double depth_m = modal.impact->calc_depth(k);
    if (depth_m <= deepest_m) return;
    deepest_m = depth_m;
    const ModalContact& contact = modal.contacts[k];
    normal = (contact.forces.a == pair.a ? 1.0 : -1.0) * contact.normal;
  });
  if (normal != Vec3{}) touches.part(pair, deepest_m, normal);
}

void ModalImpacts::follow(const Step& step, double length_s, TouchSets& touches) {
  for (ModalImpact& modal : impacts_) {
    if (!has_bodies_of(step, modal)) continue;
    for (ModalContact& contact : modal.contacts) contact.is_followed = false;
    for (int n = 0; const impact::Body& b : modal.impact->get_bodies())
      if (const int body = modal.bodies[n++]; bodies_.has_modes(body)) note_swing(bodies_, body, b.q, b.q_dot);
    const auto is_in = [&](int body) { return std::find(modal.bodies.begin(), modal.bodies.end(), body) != modal.bodies.end(); };
    std::vector<Pair*> pairs;
    double fastest_m_s = 0.0;  // the impact may pass this speed to any of its bodies
    for (Pair* pair : step.island().pairs) {
      if (pair->cord >= 0 || !step.has(*pair) || !(is_in(pair->a) || is_in(pair->b))) continue;
      if (!may_join(is_in(pair->a), pair->a) || !may_join(is_in(pair->b), pair->b)) continue;
      pairs.push_back(pair);
      fastest_m_s = std::max(fastest_m_s, bodies_.calc_closing_speed(pair->a, pair->b));
    }
    for (Pair* pair : pairs) {
      part(*pair, touches);
      touches.search(*pair, length_s, fastest_m_s);
      touches.complete_in_flight(*pair, length_s);
      follow(modal, *pair, fastest_m_s * length_s, length_s, touches);
    }
  }
}

double ModalImpacts::limit_part(const Step& step, double length_s) const {
  for (const ModalImpact& modal : impacts_) {
    if (!has_bodies_of(step, modal)) continue;
    double farthest_m = calc_deepest(modal), fastest_m_s = 0.0;
    for (const int body : modal.bodies) {
      farthest_m = std::max(farthest_m, bodies_.get_swing(body));
      fastest_m_s = std::max(fastest_m_s, bodies_.calc_speed(body));
    }
    if (farthest_m < kFarYieldedM) continue;
    length_s = std::min(length_s, std::max(kMinPartS, kMaxPartM / fastest_m_s));
  }
  return length_s;
}

bool ModalImpacts::may_meet_others(const Step& step, double length_s, TouchSets& touches) {
  for (Pair* pair : step.island().pairs) {
    if (pair->cord >= 0 || pair->b < 0) continue;
    for (const auto& [body, other] : {std::pair(pair->a, pair->b), std::pair(pair->b, pair->a)}) {
      if (!bodies_.is_moved_by_impact(body)) continue;
      const std::vector<int>& members = find(body)->bodies;
      const auto is_in = [&](int i) { return std::find(members.begin(), members.end(), i) != members.end(); };
      if (is_in(body) && may_join(is_in(other), other)) continue;
      double fastest_m_s = 0.0;
      for (const int member : members) fastest_m_s = std::max(fastest_m_s, bodies_.calc_speed(member));
      touches.search(*pair, length_s, 2.0 * fastest_m_s);
      const double reach_m = 2.0 * fastest_m_s * length_s + bodies_.get_swing(body) + bodies_.get_swing(other);
      if (std::any_of(pair->contacts.begin(), pair->contacts.end(), [&](const Contact& c) { return c.touch.gap_m < reach_m; })) return true;
    }
  }
  return false;
}

/// Reason to end an impact before its contacts have separated.
ModalImpacts::End ModalImpacts::find_end(const ModalImpact& modal, double time_s) {
  bool is_slow = true;  // also where a body rolls or slides fast
  for (int k = 0; k < static_cast<int>(modal.contacts.size()); ++k)
    is_slow = is_slow && (!(modal.impact->get_compression(k) > 0.0) || std::abs(modal.impact->calc_approach(k)) < kRattleSpeedMS);
  // A deep one would have to be lifted.
  if (is_slow && modal.rolled > kMaxRolled && calc_deepest(modal) <= kMaxDepthM) return End::rolls;
  return time_s - modal.start_s > (is_slow ? kMaxSlowImpactS : kMaxImpactS) ? End::lasts : End::none;
}

/// Contacts of an impact at the current poses, for a part of this length. `shapes`: takes the mode shapes that they refer to.
std::vector<impact::Contact> ModalImpacts::place_springs(const ModalImpact& modal, const std::vector<impact::Body>& bodies, double part_s,
                                                         std::list<std::vector<double>>& shapes) const {
  std::vector<impact::Contact> springs;
  const std::vector<impact::Spring> laws = find_springs(modal, part_s);
  for (int k = 0; const ModalContact& contact : modal.contacts) {
    impact::Contact& spring = springs.emplace_back(modal.impact->get_contact(k));
    spring.spring = laws[k++];
    spring.where_m = find_station(contact);
    if (contact.is_followed) spring.normal = contact.normal;
    if (!contact.shape_a.empty()) spring.shape_a = shapes.emplace_back(turn_to_world(contact.forces.a, contact.shape_a));
    if (!contact.shape_b.empty()) spring.shape_b = shapes.emplace_back(turn_to_world(contact.forces.b, contact.shape_b));
    spring.gap_m = contact.is_followed ? std::max(contact.gap_m + calc_yield(spring, bodies), 0.0) : -modal.impact->get_compression(k - 1);
  }
  return springs;
}

void ModalImpacts::advance(const Step& step, double to_s, double part_s, double window_end_s, TouchSets& touches) {
  for (ModalImpact& modal : impacts_) {
    if (!has_bodies_of(step, modal) || !(part_s > 0.0)) continue;
    std::vector<impact::Body> bodies = modal.impact->get_bodies();
    const int count = static_cast<int>(bodies.size());
    // A struck sleeping body now moves or belongs to another island: the impact cannot continue unchanged.
    bool is_whole = true;
    for (int k = 0; k < count; ++k)
      is_whole = is_whole && bodies_.moves(modal.bodies[k]) == (bodies[k].mass_kg > 0.0) && step.has(modal.bodies[k]);
    if (!is_whole) {
      release(modal, to_s, touches);  // its bodies do not move in this part
      continue;
    }
    std::vector<joints::Spatial> pulls(count);
    for (int k = 0; k < count; ++k) {
      const int body = modal.bodies[k], n = step.find(body);
      if (n < 0) continue;
      impact::Body& b = bodies[k];
      set_motion(body, b);
      if (!b.on_joints) b.spin_acceleration_rad_s2 = (1.0 / step.length_s) * (step.free[n].placed.spin - bodies_.placed(body).spin);
      // Cords and other contacts act as long as the impact lasts in this part; its own steps may be longer.
      const Vec3 free = b.on_joints ? step.free[n].state.velocity : bodies_.state(body).velocity + step.length_s * bodies_.gravity();
      pulls[k] = {(1.0 / step.length_s) * (step.movers[n].velocity - free),
                  (1.0 / step.length_s) * (step.movers[n].spin - step.free[n].placed.spin)};
      b.acceleration_m_s2 = b.acceleration_m_s2 + pulls[k].linear;
      b.spin_acceleration_rad_s2 = b.spin_acceleration_rad_s2 + pulls[k].angular;
    }
    std::list<std::vector<double>> shapes;
    const std::vector<impact::Contact> springs = place_springs(modal, bodies, part_s, shapes);
    modal.impact->update(bodies, springs);
    for (int k = 0; k < count; ++k)
      push(*modal.impact, k, bodies[k], bodies_.state(modal.bodies[k]).velocity, bodies_.placed(modal.bodies[k]).spin);
    const double begun_s = modal.impact->get_time();
    const bool ended = modal.impact->advance(to_s - modal.start_s);
    bodies = modal.impact->get_bodies();
    for (int k = 0; k < count; ++k) {
      const int body = modal.bodies[k], n = step.find(body);
      if (n < 0) continue;
      if (const int number = step.free[n].articulation; number >= 0) {
        move_articulation(step.articulations[number], bodies[k], modal.impact->get_time() - begun_s, step.length_s);
        continue;
      }
      give_pull(step, n, bodies[k].moved_m, bodies[k].turned_rad);
      State& s = bodies_.state(body);
      s.velocity = bodies[k].velocity_m_s;
      s.centre = s.centre + bodies[k].moved_m;
      s.rotation = normalise(multiply(make_turn(bodies[k].turned_rad), s.rotation));
      s.momentum = calc_momentum(bodies_.solid(body), s.rotation, bodies[k], pulls[k].angular);
    }
    keep_pulses(modal);
    (void)retain(modal);
    if (to_s >= window_end_s - 1e-9)  // once per window, to avoid many short pieces
      for (ModalContact& contact : modal.contacts) report(contact);
    const End end = find_end(modal, to_s);
    if (!ended && end == End::none) continue;
    if (end == End::rolls)
      for (Pair* pair : step.island().pairs)
        if (has_contact(modal, *pair)) pair->quiet_until(to_s + kRattleS);
    // The impact, and the other forces with it, extend beyond the end of the part.
    const double beyond_s = modal.start_s + modal.impact->get_time() - to_s;
    const std::vector<int> moved = modal.bodies;
    release(modal, to_s, touches);
    for (int k = 0; k < count; ++k)
      if (beyond_s > 0.0 && bodies_.moves(moved[k])) undo_pull(step, moved[k], pulls[k], beyond_s);
  }
  impacts_.remove_if([](const ModalImpact& modal) { return modal.impact == nullptr; });
}

/// Moves the articulation of a body moved by an impact by `time_s`, including the effect of the step's contacts.
void ModalImpacts::move_articulation(const ArticulationStep& step, const impact::Body& struck, double time_s, double step_s) {
  Articulation& articulation = *step.articulation;
  joints::Mechanism& mechanism = *articulation.mechanism;
  const auto calc = [&] {
    double kinetic = 0.0, all = articulation.now.lost_j;
    for (const int body : articulation.bodies) {
      kinetic += calc_kinetic(bodies_.solid(body), bodies_.state(body));
      all += calc_energy(bodies_.solid(body), bodies_.state(body), bodies_.gravity());
    }
    return std::pair(kinetic, all);
  };
  const double before = calc().second;
  joints::Coordinates moved = bodies_.fly(articulation, articulation.now, time_s);
  std::vector<joints::Spatial> impulses(articulation.bodies.size()), shifts(articulation.bodies.size());
  impulses[articulation.struck] = {struck.impulse_n_s, struck.couple_n_m_s};
  shifts[articulation.struck] = {struck.shift_n_s2, struck.turning_n_m_s2};
  const std::vector<double> du = mechanism.calc_push(moved, impulses), dq = mechanism.calc_push(moved, shifts);
  moved = mechanism.move(moved, dq, 0.0, 1.0);
  moved = mechanism.move(moved, du, 1.0, 0.0);
  if (!step.push.empty()) moved = mechanism.move(moved, step.push, time_s / step_s, 0.5 * time_s * time_s / step_s);
  articulation.now = std::move(moved);
  bodies_.place(articulation);
  if (!step.push.empty() || !articulation.is_anchored) return;
  // The impact used a constant mobility: the deviation of the kinetic energy from the work of the contacts is corrected by scaling the
  // change of all velocities.
  const auto [kinetic, after] = calc();
  const double gained = after - before - struck.work_j;
  if (!(std::abs(gained) < kMaxCorrectionRatio * kinetic)) return;
  const double part = std::sqrt(1.0 - gained / kinetic);
  for (double& u : articulation.now.u) u *= part;
  bodies_.place(articulation);
}

/// Books the work of a grab on the nth body of the step, while an impact moves it.
void ModalImpacts::give_pull(const Step& step, int n, const Vec3& moved, const Vec3& turned) {
  if (!step.pulls.empty()) ledger_.give((1.0 / step.length_s) * (dot(step.pulls[n].linear, moved) + dot(step.pulls[n].angular, turned)));
}

/// Reverts the effect of cords and other contacts on a body in the last `time_s`.
void ModalImpacts::undo_pull(const Step& step, int body, const joints::Spatial& pull, double time_s) {
  if (pull.linear == Vec3{} && pull.angular == Vec3{}) return;
  if (const int number = step.free[step.find(body)].articulation; number >= 0) {
    const ArticulationStep& a = step.articulations[number];
    joints::Coordinates& now = a.articulation->now;
    if (!a.push.empty()) now = a.articulation->mechanism->move(now, a.push, -time_s / step.length_s, 0.5 * time_s * time_s / step.length_s);
    bodies_.place(*a.articulation);
    return;
  }
  State& s = bodies_.state(body);
  const Vec3 mean = s.velocity - (0.5 * time_s) * pull.linear,
             mean_spin = bodies_.placed(body).inverse_inertia * s.momentum - (0.5 * time_s) * pull.angular;
  give_pull(step, step.find(body), -time_s * mean, -time_s * mean_spin);
  s.velocity = s.velocity - time_s * pull.linear;
  s.centre = s.centre + (0.5 * time_s * time_s) * pull.linear;
  s.momentum = s.momentum - time_s * (bodies_.calc_inertia(body) * pull.angular);
  bodies_.place(body);
}

/// Converts the forces of an impact since the last call to the current frames of its bodies.
void ModalImpacts::keep_pulses(ModalImpact& modal) {
  for (const impact::Pulse& pulse : modal.impact->take_pulses()) {
    ModalContact& contact = modal.contacts[pulse.contact];
    Forces& forces = contact.forces;
    const double start_s = modal.start_s + pulse.start_s;
    // A contact that was open for a while starts a new pulse.
    if (!forces.on_a.empty() &&
        std::abs(start_s - forces.time_s - forces.step_s * static_cast<double>(forces.on_a.size())) > 0.5 * forces.step_s)
      report(contact);
    if (forces.on_a.empty()) forces.time_s = start_s;
    forces.step_s = pulse.step_s;
    const Mat3 to_a = transpose(bodies_.placed(forces.a).rotation),
               to_b = forces.b >= 0 ? transpose(bodies_.placed(forces.b).rotation) : Mat3{};
    for (const Vec3& impulse : pulse.impulse_n_s) {
      forces.on_a.push_back(to_a * impulse);
      if (forces.b >= 0) forces.on_b.push_back(to_b * (-1.0 * impulse));
    }
  }
}

void ModalImpacts::report(ModalContact& contact) {
  Forces& forces = contact.forces;
  if (forces.on_a.empty()) return;
  forces_.push_back(forces);
  forces.on_a.clear();
  forces.on_b.clear();
  forces.continues = true;
}

/// Keeps of the losses since the last call the work that compressed contacts need to recover against gravity. Returns this work, beyond
/// the energy of the springs.
double ModalImpacts::retain(ModalImpact& modal) const {
  const impact::Books books = modal.impact->get_books();
  double weight_n = 0.0;
  for (const int body : modal.bodies)
    if (bodies_.moves(body)) weight_n += bodies_.solid(body).mass_kg * norm(bodies_.gravity());
  const double lost_j = calc_lost(books), more_j = lost_j - std::exchange(modal.lost_j, lost_j);
  const double work_j = std::max(0.0, weight_n * calc_deepest(modal) - books.spring);
  modal.retained_j = std::clamp(work_j - books.yielded, 0.0, std::max(0.0, modal.retained_j + more_j));
  return work_j;
}

/// Returns the modal states of an impact's bodies, which may be ahead of `time_s` by part of its step.
void ModalImpacts::release(ModalImpact& modal, double time_s, TouchSets& touches) {
  keep_pulses(modal);
  for (ModalContact& contact : modal.contacts) report(contact);
  const std::vector<impact::Body> bodies = modal.impact->get_bodies();
  const double reached_s = modal.start_s + modal.impact->get_time();
  if (!modal.impact->has_ended()) ++ledger_.costs.ended_impacts;
  ledger_.costs.longest_impact_s = std::max(ledger_.costs.longest_impact_s, modal.impact->get_time());
  const impact::Books books = modal.impact->get_books();
  const double work_j = retain(modal), kept_j = std::clamp(books.yielded + modal.retained_j, 0.0, work_j);
  ledger_.lose(calc_lost(books) + books.yielded - kept_j + books.dissipated_friction + books.above_band);
  for (int k = 0; const impact::Body& b : bodies) {
    const int body = modal.bodies[k++];
    bodies_.set_in_impact(body, false);
    if (bodies_.has_modes(body)) states_.set(body, {b.q, b.q_dot, reached_s});
    if (Articulation* articulation = bodies_.find_articulation(body); articulation != nullptr && bodies_.moves(body)) {
      articulation->struck = -1;
      if (reached_s > time_s) articulation->now = bodies_.fly(*articulation, articulation->now, time_s - reached_s);
      bodies_.place(*articulation);
      continue;
    }
    State& s = bodies_.state(body);
    if (bodies_.moves(body) && reached_s > time_s) s = fly(bodies_.solid(body), s, bodies_.gravity(), time_s - reached_s);
    bodies_.place(body);
  }
  const double stored_j = (books.spring + kept_j) / static_cast<double>(modal.contacts.size());
  for (int k = 0; const ModalContact& contact : modal.contacts)
    touches.release(contact.forces.a, contact.forces.b, std::max(0.0, modal.impact->calc_depth(k++)), stored_j);
  modal.impact = nullptr;
  modal.bodies.clear();
}

void ModalImpacts::end(ModalImpact& modal, TouchSets& touches) {
  release(modal, bodies_.get_time(), touches);
  impacts_.remove_if([](const ModalImpact& m) { return m.impact == nullptr; });
}

void ModalImpacts::add_to(Books& books) const {
  for (const ModalImpact& modal : impacts_) {
    const impact::Books inside = modal.impact->get_books();
    books.modes_j += inside.modal;
    books.springs_j += inside.spring + inside.yielded + modal.retained_j;
    books.lost_j += calc_lost(inside) - modal.retained_j + inside.dissipated_friction + inside.above_band;
  }
}

}  // namespace carillon::rigid
