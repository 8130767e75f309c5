// Impacts with modes from their prediction to their end, all of it on the same impacts; longer than most files.
// Method: an impact whose bodies ring is integrated with their modes. Where the modes would get less than 2 % of the energy, the rigid
//   impact and the Hertz pulse stand.
// Source: runtime/impact/impact.hpp; docs/decisions/impact.md.
// Deviations: none.
#include "runtime/rigid/modal_impact.hpp"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "runtime/impact/predict.hpp"
#include "runtime/rigid/limits.hpp"

namespace carillon::rigid {
namespace {

constexpr int kMaxHits = 8;          // of one impact
constexpr int kMaxTogether = 12;     // with those that rest
constexpr double kLongest = 50e-3;   // s; what presses for longer rests
constexpr double kRight = 0.01;      // of the kinetic energy: the most that a step of an impact on joints is corrected by
constexpr double kSamePlace = 0.05;  // of the size

/// (n) along a direction.
std::vector<double> project(const std::vector<double>& shape, const Vec3& along) {
  std::vector<double> phi(shape.size() / 3);
  for (int m = 0; double& value : phi) {
    value = shape[m] * along[0] + shape[m + 1] * along[1] + shape[m + 2] * along[2];
    m += 3;
  }
  return phi;
}

/// Does it carry, or is it about to, outside of all impacts?
bool is_resting(const Contact& c) { return !c.presses && c.cord < 0 && c.touch.gap_m <= kTouch; }

impact::Spring make_spring(const Bodies& bodies, const Hit& hit) {
  return {.stiffness =
              impact::calc_hertz_stiffness(bodies.calc_compliance(hit.a, hit.b), bodies.calc_contact_radius(hit.touch, hit.a, hit.b))};
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

/// An impact that a hit belongs to: one of its bodies is in it. None where either body is in one that moves bodies outside of the island.
ModalImpact* ModalImpacts::find_own(const Step& step, const Hit& hit) {
  ModalImpact* own = nullptr;
  for (const int body : {hit.a, hit.b}) {
    ModalImpact* modal = find(body);
    if (modal == nullptr) continue;
    if (!std::all_of(modal->bodies.begin(), modal->bodies.end(), [&](int other) { return step.has(other); })) return nullptr;
    if (own == nullptr) own = modal;
  }
  return own;
}

/// Where the point of a contact is now, by the body that moves.
Vec3 ModalImpacts::find_station(const ModalContact& contact) const {
  const int body = bodies_.moves(contact.a) ? contact.a : contact.b;
  return bodies_.state(body).centre + bodies_.placed(body).rotation * contact.station;
}

bool ModalImpacts::is_pressed(const Pair& pair, const Vec3& where) const {
  if (impacts_.empty()) return false;
  const double near = kSamePlace * bodies_.calc_size(pair.a, pair.b);
  for (const ModalImpact& modal : impacts_)
    for (const ModalContact& contact : modal.contacts) {
      const bool is_same = (contact.a == pair.a && contact.b == pair.b) || (contact.b == pair.a && contact.a == pair.b);
      if (is_same && norm(find_station(contact) - where) < near) return true;
    }
  return false;
}

bool ModalImpacts::predict(const Step& step, Collision& collision) {
  bool integrate = false;
  for (int n = 0; Hit & hit : collision.hits) {
    const Contact& c = collision.contacts[n].get();
    Point& point = collision.points[n++];
    if (!(hit.approach_m_s > kSlowest) || c.is_closed()) continue;
    if (!hit.is_cord && find_own(step, hit) != nullptr) {
      integrate = true;
      continue;
    }
    if (hit.is_cord || (!bodies_.has_modes(hit.a) && !bodies_.has_modes(hit.b))) continue;
    if (!(hit.restitution > 0.0)) continue;  // it stays: weight keeps the surfaces together (rigid_impact.cpp)
    const double inverse_mass = dot(hit.touch.normal, calc_mobility(collision.movers, point) * hit.touch.normal);
    std::vector<double> phi[2];
    impact::Side sides[2];
    // A shelf has one modal state: while an impact of another island has it, those that strike it meanwhile do so as rigid bodies.
    bool is_free = true;
    for (const int side : {0, 1}) {
      const int body = side == 0 ? hit.a : hit.b;
      if (!bodies_.has_modes(body)) continue;
      if (bodies_.is_in_impact(body)) {
        is_free = false;
        continue;
      }
      phi[side] = project(find_shape(bodies_, hit, side == 0), transpose(bodies_.placed(body).rotation) * hit.touch.normal);
      const ModalState& state = states_.advance(body, bodies_.get_time());
      sides[side] = {bodies_.solid(body).modes.get(), phi[side], state.q, state.q_dot};
    }
    const impact::Prediction p =
        impact::predict(make_spring(bodies_, hit), 1.0 / inverse_mass, hit.approach_m_s, hit.restitution, sides[0], sides[1]);
    integrate = integrate || (!p.is_enough && is_free);
    if (p.restitution < hit.restitution) {
      hit.restitution = p.restitution;
      point.wanted = (hit.restitution * hit.approach_m_s) * hit.touch.normal;
    }
  }
  return integrate;
}

/// The motion of a body as an impact begins or continues with it.
void ModalImpacts::set_motion(int body, impact::Body& b) const {
  const State& state = bodies_.state(body);
  const Placed& placed = bodies_.placed(body);
  b.centre_m = state.centre;
  b.inertia_kg_m2 = placed.rotation * (bodies_.solid(body).inertia_kg_m2 * transpose(placed.rotation));
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

impact::Body ModalImpacts::make_body(int body) {
  impact::Body b;
  b.centre_m = bodies_.state(body).centre;
  if (bodies_.moves(body)) {
    b.mass_kg = bodies_.solid(body).mass_kg;
    b.velocity_m_s = bodies_.state(body).velocity;
    b.spin_rad_s = bodies_.placed(body).spin;
    set_motion(body, b);
  }
  if (bodies_.has_modes(body)) {
    const ModalState& state = states_.advance(body, bodies_.get_time());
    b.modes = bodies_.solid(body).modes.get();
    b.q = state.q;
    b.q_dot = state.q_dot;
  }
  return b;
}

/// Shapes of a body in world axes.
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

/// What is struck and leans on something else is struck with what stands behind it: adds the contacts that rest on the bodies of `order`,
/// and on the bodies that these lean on. False where they are too many, or bodies on joints or another impact are among them: the rigid
/// impact stands.
bool ModalImpacts::add_resting(const Collision& collision, const Instants& instants, std::vector<int>& order) const {
  const std::vector<Hit>& hits = collision.hits;
  const int count = static_cast<int>(hits.size());
  std::vector<char> is_taken(count, 0);
  std::set<int> struck;
  for (const int n : order) {
    is_taken[n] = 1;
    for (const int body : {hits[n].a, hits[n].b})
      if (bodies_.moves(body) && !bodies_.is_moved_by_impact(body)) struck.insert(body);
  }
  const auto hit_count = order.size();
  for (bool grows = true; std::exchange(grows, false);)
    for (int n = 0; n < count; ++n) {
      const Contact& c = collision.contacts[n].get();
      if (is_taken[n] || !is_resting(c)) continue;
      const bool leans = std::any_of(struck.begin(), struck.end(),
                                     [&](int body) { return bodies_.share_motion(body, c.a) || bodies_.share_motion(body, c.b); });
      if (!leans) continue;
      for (const int body : {c.a, c.b}) {
        if (body < 0) continue;
        if (bodies_.find_articulation(body) != nullptr || bodies_.is_in_impact(body)) return false;
        if (instants.is_crowded(body, bodies_.get_time())) return false;
        if (bodies_.moves(body)) struck.insert(body);
      }
      is_taken[n] = 1;
      order.push_back(n);
      grows = true;
    }
  std::sort(order.begin(), order.end());
  return order.size() == hit_count || order.size() <= kMaxTogether;
}

/// Are two members of one articulation struck?
bool ModalImpacts::shares_articulations(const std::vector<Hit>& hits, const std::vector<int>& order) const {
  std::map<const Articulation*, int> struck;
  for (const int n : order)
    for (const int body : {hits[n].a, hits[n].b}) {
      const Articulation* articulation = bodies_.moves(body) ? bodies_.find_articulation(body) : nullptr;
      if (articulation == nullptr) continue;
      const int first = articulation->struck >= 0 ? articulation->bodies[articulation->struck] : body;
      if (struck.emplace(articulation, first).first->second != body) return true;
    }
  return false;
}

std::optional<ModalImpacts::Selection> ModalImpacts::select(const Step& step, const Collision& collision, const Instants& instants) {
  const std::vector<Hit>& hits = collision.hits;
  Selection selection;
  std::vector<int>& order = selection.order;
  std::vector<char>& rests = selection.rests;
  rests.assign(hits.size(), 1);
  for (int n = 0; n < static_cast<int>(hits.size()); ++n) {
    if (!(hits[n].approach_m_s > kSlowest) || hits[n].is_cord) continue;
    order.push_back(n);
    rests[n] = 0;
  }
  if (order.empty() || !add_resting(collision, instants, order) || shares_articulations(hits, order)) return std::nullopt;
  // A hit on a body (such as a shelf) that is in an impact of another island stays out of this one.
  std::erase_if(order,
                [&](int n) { return find_own(step, hits[n]) == nullptr && (find(hits[n].a) != nullptr || find(hits[n].b) != nullptr); });
  if (std::all_of(order.begin(), order.end(), [&](int n) { return rests[n] != 0; })) return std::nullopt;  // all hits stay out
  return selection;
}

/// The impact that the selected contacts join: those of all bodies that meet become one. None: they begin one; where they are too many
/// together the old ones end, and the fastest begin it. False: none of that, as too many rest.
bool ModalImpacts::join(const std::vector<Hit>& hits, Selection& selection, TouchSets& touches, ModalImpact*& joined) {
  std::vector<int>& order = selection.order;
  for (const int n : order)
    for (const int body : {hits[n].a, hits[n].b}) {
      ModalImpact* found = find(body);
      if (found == nullptr || found == joined) continue;
      if (joined == nullptr)
        joined = found;
      else
        end(*found, touches);  // what it has in its springs is lost
    }
  const bool leans = std::any_of(order.begin(), order.end(), [&](int n) { return selection.rests[n] != 0; });
  const auto together = order.size() + (joined != nullptr ? joined->contacts.size() : 0);
  if (leans) return together <= kMaxTogether;
  if (together <= kMaxHits) return true;
  if (joined != nullptr) end(*std::exchange(joined, nullptr), touches);
  if (order.size() > kMaxHits) {
    std::stable_sort(order.begin(), order.end(), [&](int x, int y) { return hits[x].approach_m_s > hits[y].approach_m_s; });
    order.resize(kMaxHits);
    std::sort(order.begin(), order.end());
  }
  return true;
}

/// The number of a body in an impact, which it joins where it was not in it; -1: static. An impact that has not begun gets it by `made`.
int ModalImpacts::add_body(ModalImpact& modal, int body, std::vector<impact::Body>& made) {
  if (body < 0 || (!bodies_.moves(body) && !bodies_.has_modes(body))) return -1;
  const auto at = std::find(modal.bodies.begin(), modal.bodies.end(), body);
  if (at != modal.bodies.end()) return static_cast<int>(at - modal.bodies.begin());
  modal.bodies.push_back(body);
  bodies_.set_in_impact(body, true);
  if (Articulation* articulation = bodies_.moves(body) ? bodies_.find_articulation(body) : nullptr; articulation != nullptr)
    articulation->struck = bodies_.get_member(body);
  if (modal.impact != nullptr) return modal.impact->join(make_body(body));
  made.push_back(make_body(body));
  return static_cast<int>(made.size()) - 1;
}

/// A contact and how the impact sees it, without its bodies and shapes.
std::pair<ModalContact, impact::Contact> ModalImpacts::make_contact(Hit& hit, bool rests) {
  ModalContact contact;
  contact.a = hit.a;
  contact.b = hit.b;
  const int body = bodies_.moves(hit.a) ? hit.a : hit.b;
  contact.station = transpose(bodies_.placed(body).rotation) * (hit.touch.where_m - bodies_.state(body).centre);
  contact.place_a = find_place(bodies_, hit, true);
  if (bodies_.has_modes(hit.a)) contact.shape_a = find_shape(bodies_, hit, true);
  if (hit.b >= 0) contact.place_b = find_place(bodies_, hit, false);
  if (bodies_.has_modes(hit.b)) contact.shape_b = find_shape(bodies_, hit, false);
  impact::Contact spring;
  spring.where_m = hit.touch.where_m;
  spring.normal = hit.touch.normal;
  // Surfaces are where the motion of the rigid bodies has them; what modes lift or lower there is small, and must not press a spring.
  spring.rests = rests;
  spring.gap_m = rests ? 0.0 : std::max(hit.touch.gap_m, 0.0);
  spring.spring = make_spring(bodies_, hit);
  spring.restitution = bodies_.calc_restitution(hit.a, hit.b);
  spring.is_limit = true;
  spring.friction = bodies_.calc_friction(hit.a, hit.b);
  return {std::move(contact), spring};
}

bool ModalImpacts::begin(const Step& step, Collision& collision, const Instants& instants, TouchSets& touches) {
  std::optional<Selection> selection = select(step, collision, instants);
  ModalImpact* joined = nullptr;
  if (!selection || !join(collision.hits, *selection, touches, joined)) return false;
  const bool is_new = joined == nullptr;
  if (is_new) {
    joined = &impacts_.emplace_back();
    joined->start_s = bodies_.get_time();
  }
  ModalImpact& modal = *joined;
  std::vector<impact::Body> bodies;
  std::vector<impact::Contact> springs;
  std::list<std::vector<double>> shapes;  // kept until the impact has them
  for (const int n : selection->order) {
    Hit& hit = collision.hits[n];
    int a = add_body(modal, hit.a, bodies), b = add_body(modal, hit.b, bodies);
    auto [contact, spring] = make_contact(hit, selection->rests[n] != 0);
    if (!contact.shape_a.empty()) spring.shape_a = shapes.emplace_back(turn_to_world(hit.a, contact.shape_a));
    if (!contact.shape_b.empty()) spring.shape_b = shapes.emplace_back(turn_to_world(hit.b, contact.shape_b));
    if (a < 0) {
      // Static bodies are side b.
      std::swap(a, b);
      spring.normal = -1.0 * spring.normal;
      std::swap(spring.shape_a, spring.shape_b);
      std::swap(contact.a, contact.b);
      std::swap(contact.place_a, contact.place_b);
      std::swap(contact.shape_a, contact.shape_b);
    }
    spring.a = a;
    spring.b = b;
    Contact& c = collision.contacts[n].get();
    c.presses = true;
    c.touching = false;
    c.impulse = c.couple = {};
    contact.waiting.a = contact.a;
    contact.waiting.b = contact.b;
    contact.waiting.place_a = contact.place_a;
    contact.waiting.place_b = contact.place_b;
    modal.contacts.push_back(std::move(contact));
    if (is_new)
      springs.push_back(spring);
    else
      modal.impact->join(spring);
  }
  if (is_new) modal.impact = std::make_unique<impact::Impact>(std::move(bodies), std::move(springs));
  ++ledger_.costs.impacts;
  return true;
}

void ModalImpacts::end(const std::vector<Hit>& hits, TouchSets& touches) {
  for (const Hit& hit : hits)
    for (const int body : {hit.a, hit.b})
      if (bodies_.is_moved_by_impact(body)) end(*find(body), touches);
}

void ModalImpacts::end_where_resting(const Step& step, TouchSets& touches) {
  if (impacts_.empty()) return;
  for (const Pair* pair : step.island().pairs)
    for (const Contact& c : pair->contacts) {
      if (!is_resting(c)) continue;
      for (const int body : {pair->a, pair->b}) {
        ModalImpact* modal = bodies_.moves(body) ? find(body) : nullptr;
        if (modal != nullptr && std::abs(bodies_.calc_approach(c.touch, c.a, c.b)) <= kSlowest) end(*modal, touches);
      }
    }
}

void ModalImpacts::advance(const Step& step, double to_s, double part_s, double window_end_s, TouchSets& touches) {
  for (ModalImpact& modal : impacts_) {
    const bool is_here = std::any_of(modal.bodies.begin(), modal.bodies.end(), [&](int body) { return step.find(body) >= 0; });
    if (!is_here || !(part_s > 0.0)) continue;
    std::vector<impact::Body> bodies = modal.impact->get_bodies();
    const int count = static_cast<int>(bodies.size());
    // A body that slept when it was struck has come to move, or belongs to another island: the impact cannot continue as it was.
    bool is_whole = true;
    for (int k = 0; k < count; ++k)
      is_whole = is_whole && bodies_.moves(modal.bodies[k]) == (bodies[k].mass_kg > 0.0) && step.has(modal.bodies[k]);
    if (!is_whole) {
      release(modal, to_s, touches);  // its bodies stay where they are for this part
      continue;
    }
    std::vector<joints::Spatial> pulls(count);
    for (int k = 0; k < count; ++k) {
      const int body = modal.bodies[k], n = step.find(body);
      if (n < 0) continue;
      impact::Body& b = bodies[k];
      set_motion(body, b);
      // What cords and other contacts do acts as long as the impact continues in this part, whose own steps may be longer.
      const Vec3 free = b.on_joints ? step.free[n].state.velocity : bodies_.state(body).velocity + step.length_s * bodies_.gravity();
      pulls[k] = {(1.0 / step.length_s) * (step.movers[n].velocity - free),
                  (1.0 / step.length_s) * (step.movers[n].spin - step.free[n].placed.spin)};
      b.acceleration_m_s2 = b.acceleration_m_s2 + pulls[k].linear;
      b.spin_acceleration_rad_s2 = b.spin_acceleration_rad_s2 + pulls[k].angular;
    }
    std::vector<impact::Contact> springs;
    std::list<std::vector<double>> shapes;
    for (int k = 0; const ModalContact& contact : modal.contacts) {
      impact::Contact& spring = springs.emplace_back(modal.impact->get_contact(k++));
      spring.where_m = find_station(contact);
      if (!contact.shape_a.empty()) spring.shape_a = shapes.emplace_back(turn_to_world(contact.a, contact.shape_a));
      if (!contact.shape_b.empty()) spring.shape_b = shapes.emplace_back(turn_to_world(contact.b, contact.shape_b));
    }
    modal.impact->update(bodies, springs);
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
      State& s = bodies_.state(body);
      s.velocity = bodies[k].velocity_m_s;
      s.centre = s.centre + bodies[k].moved_m;
      s.rotation = normalise(multiply(make_turn(bodies[k].turned_rad), s.rotation));
      const Mat3 rotation = make_rotation(s.rotation);
      s.momentum = rotation * (bodies_.solid(body).inertia_kg_m2 * (transpose(rotation) * bodies[k].spin_rad_s));
    }
    keep_pulses(modal);
    // Once a window: pieces of a small step each would be many.
    if (to_s >= window_end_s - 1e-9)
      for (ModalContact& contact : modal.contacts) report(contact);
    if (!ended && to_s - modal.start_s <= kLongest) continue;
    // It has gone beyond the end of the part, and so did the pulls.
    const double beyond_s = modal.start_s + modal.impact->get_time() - to_s;
    const std::vector<int> moved = modal.bodies;
    release(modal, to_s, touches);
    for (int k = 0; k < count; ++k)
      if (beyond_s > 0.0 && bodies_.moves(moved[k])) undo_pull(step, moved[k], pulls[k], beyond_s);
  }
  impacts_.remove_if([](const ModalImpact& modal) { return modal.impact == nullptr; });
}

/// The articulation of a body that an impact has moved by `time_s`, of which the contacts of the step have their part.
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
  // The impact has taken its mobility for constant: the difference of the motion's energy from the contacts' work is corrected, as a change
  // of all its velocities by the same part.
  const auto [kinetic, after] = calc();
  const double gained = after - before - struck.work_j;
  if (!(std::abs(gained) < kRight * kinetic)) return;
  const double part = std::sqrt(1.0 - gained / kinetic);
  for (double& u : articulation.now.u) u *= part;
  bodies_.place(articulation);
}

/// Takes the effect of cords and other contacts on a body in the last `time_s` back.
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
  const Mat3& rotation = bodies_.placed(body).rotation;
  s.velocity = s.velocity - time_s * pull.linear;
  s.centre = s.centre + (0.5 * time_s * time_s) * pull.linear;
  const Mat3 inertia = rotation * (bodies_.solid(body).inertia_kg_m2 * transpose(rotation));
  s.momentum = s.momentum - time_s * (inertia * pull.angular);
  bodies_.place(body);
}

/// Takes the forces of an impact since the last time into the frames of its bodies, as they are now.
void ModalImpacts::keep_pulses(ModalImpact& modal) {
  for (const impact::Pulse& pulse : modal.impact->take_pulses()) {
    ModalContact& contact = modal.contacts[pulse.contact];
    Forces& forces = contact.waiting;
    const double start_s = modal.start_s + pulse.start_s;
    // A contact that was open for a while begins again.
    if (!forces.on_a.empty() &&
        std::abs(start_s - forces.time_s - forces.step_s * static_cast<double>(forces.on_a.size())) > 0.5 * forces.step_s)
      report(contact);
    if (forces.on_a.empty()) forces.time_s = start_s;
    forces.step_s = pulse.step_s;
    const Mat3 to_a = transpose(bodies_.placed(contact.a).rotation),
               to_b = contact.b >= 0 ? transpose(bodies_.placed(contact.b).rotation) : Mat3{};
    for (const Vec3& impulse : pulse.impulse_n_s) {
      forces.on_a.push_back(to_a * impulse);
      if (contact.b >= 0) forces.on_b.push_back(to_b * (-1.0 * impulse));
    }
  }
}

void ModalImpacts::report(ModalContact& contact) {
  if (contact.waiting.on_a.empty()) return;
  Forces next = contact.waiting;
  next.on_a.clear();
  next.on_b.clear();
  next.continues = true;
  forces_.push_back(std::exchange(contact.waiting, std::move(next)));
}

/// Returns the modal states of an impact's bodies. It may be ahead of `time_s` by a part of its step.
void ModalImpacts::release(ModalImpact& modal, double time_s, TouchSets& touches) {
  keep_pulses(modal);
  for (ModalContact& contact : modal.contacts) report(contact);
  const std::vector<impact::Body> bodies = modal.impact->get_bodies();
  const double reached_s = modal.start_s + modal.impact->get_time();
  const impact::Books books = modal.impact->get_books();
  ledger_.lose(books.dissipated_modes + books.dissipated_contact + books.dissipated_friction + books.above_band + books.spring);
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
  for (const ModalContact& contact : modal.contacts) touches.release(contact.a, contact.b);
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
    books.springs_j += inside.spring;
    books.lost_j += inside.dissipated_modes + inside.dissipated_contact + inside.dissipated_friction + inside.above_band;
  }
}

}  // namespace carillon::rigid
