// Impacts with modes from their prediction to their end, all of it on the same Ringings; longer than most files.
// Method: an impact whose bodies ring is integrated with their modes inside (runtime/impact), over as many small steps as it takes. Its
//   bodies take their motion from it; what gravity and other contacts do to them enters it as accelerations, a small step at a time. Where
//   the modes would get less than 2 % of the energy, the rigid impact and the Hertz pulse stand.
// Source: runtime/impact/impact.hpp; docs/decisions/impact.md.
// Deviations: none.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "runtime/impact/predict.hpp"
#include "runtime/rigid/limits.hpp"
#include "runtime/rigid/space.hpp"

namespace carillon::rigid {
namespace {

constexpr int kMaxPresses = 8;      // of one impact
constexpr int kMaxTogether = 12;    // with those that rest
constexpr double kLongest = 50e-3;  // s; what presses for longer rests

/// (n) along a direction.
std::vector<double> project(const std::vector<double>& shape, const Vec3& along) {
  std::vector<double> phi(shape.size() / 3);
  for (std::size_t m = 0; m < phi.size(); ++m) phi[m] = shape[3 * m] * along[0] + shape[3 * m + 1] * along[1] + shape[3 * m + 2] * along[2];
  return phi;
}

}  // namespace

Space::Ringing* Space::find_ringing(int body) {
  if (const Linked* linked = find_linked(body); linked != nullptr && linked->ringing >= 0)
    body = linked->bodies[static_cast<std::size_t>(linked->ringing)];
  if (body < 0 || !in_ringing_[static_cast<std::size_t>(body)]) return nullptr;
  for (Ringing& ringing : ringings_)
    if (std::find(ringing.bodies.begin(), ringing.bodies.end(), body) != ringing.bodies.end()) return &ringing;
  return nullptr;
}

/// An impact with modes that a hit belongs to: one of its bodies is in it. None where either body is in one that moves bodies outside of
/// the group that is being stepped.
Space::Ringing* Space::find_own_ringing(const Hit& hit) {
  Ringing* own = nullptr;
  for (const int body : {hit.a, hit.b}) {
    Ringing* ringing = find_ringing(body);
    if (ringing == nullptr) continue;
    const bool is_here = std::all_of(ringing->bodies.begin(), ringing->bodies.end(),
                                     [&](int other) { return !moves(other) || index_[static_cast<std::size_t>(other)] >= 0; });
    if (!is_here) return nullptr;
    if (own == nullptr) own = ringing;
  }
  return own;
}

/// Is there an impact on its way between the two, at that place? Points get other names while bodies roll.
bool Space::is_pressed(const Pair& pair, const Vec3& where) const {
  const double near = 0.05 * calc_pair_size(pair.a, pair.b);
  for (const Ringing& ringing : ringings_)
    for (const Press& press : ringing.presses) {
      if (!(press.a == pair.a && press.b == pair.b) && !(press.b == pair.a && press.a == pair.b)) continue;
      const auto s = static_cast<std::size_t>(moves(press.a) ? press.a : press.b);
      if (norm(states_[s].centre + placed_[s].rotation * press.station - where) < near) return true;
    }
  return false;
}

/// The modal state of a body, moved on to a time; what its damping takes is lost.
Space::Ring& Space::ring_until(int body, double time_s) {
  const auto i = static_cast<std::size_t>(body);
  Ring& ring = rings_[i];
  const impact::Modes& modes = *solids_[i].modes;
  const auto count = static_cast<std::size_t>(modes.size());
  if (ring.q.empty()) {
    ring.q.assign(count, 0.0);
    ring.q_dot.assign(count, 0.0);
    ring.time_s = time_s;
  }
  if (time_s > ring.time_s) {
    const double before = modes.calc_energy(ring.q, ring.q_dot);
    if (before > 0.0) modes.move_freely(ring.q, ring.q_dot, time_s - ring.time_s);
    lost_j_ += before - modes.calc_energy(ring.q, ring.q_dot);
    ring.time_s = time_s;
  }
  return ring;
}

/// Of a body of a hit; looked for once.
const shape::Place& Space::find_place(Hit& hit, bool is_a) const {
  const std::size_t side = is_a ? 0 : 1;
  std::optional<shape::Place>& place = hit.places[side];
  if (place) return *place;
  const auto i = static_cast<std::size_t>(is_a ? hit.a : hit.b);
  const Mat3 back = transpose(placed_[i].rotation);
  place = solids_[i].shape->find_place(solids_[i].centre_m + back * (hit.touch.where_m - states_[i].centre),
                                       back * ((is_a ? -1.0 : 1.0) * hit.touch.normal), hit.triangles[side]);
  hit.triangles[side] = place->triangle;
  return *place;
}

impact::Spring Space::make_spring(const shape::Touch& touch, int a, int b) const {
  return {.stiffness = impact::calc_hertz_stiffness(calc_compliance(a, b), calc_contact_radius(touch, a, b))};
}

/// Caps the restitution of every hit by what its modes take; true where an impact has to be integrated.
bool Space::predict_hits(const std::vector<Ref>& taken, std::vector<Hit>& hits, std::vector<Point>& points) {
  bool integrate = false;
  for (std::size_t n = 0; n < hits.size(); ++n) {
    Hit& hit = hits[n];
    const Contact& c = taken[n].get();
    if (!(hit.approach_m_s > kSlowest) || (c.touching && c.touch.gap_m <= kTouch)) continue;
    if (Ringing* own = hit.is_cord ? nullptr : find_own_ringing(hit); own != nullptr) {
      integrate = true;
      continue;
    }
    if (hit.is_cord || (!rings(hit.a) && !rings(hit.b))) continue;
    if (!(hit.restitution > 0.0)) continue;  // it stays: weight keeps the surfaces together (strike())
    const double inverse_mass = dot(hit.touch.normal, calc_mobility(movers_, points[n]) * hit.touch.normal);
    const impact::Spring spring = make_spring(hit.touch, hit.a, hit.b);
    std::vector<double> phi[2];
    impact::Side sides[2];
    for (const int side : {0, 1}) {
      const int body = side == 0 ? hit.a : hit.b;
      if (!rings(body) || in_ringing_[static_cast<std::size_t>(body)]) continue;
      const auto i = static_cast<std::size_t>(body);
      phi[side] = project(solids_[i].find_shape(find_place(hit, side == 0)), transpose(placed_[i].rotation) * hit.touch.normal);
      Ring& ring = ring_until(body, std::max(time_s_, rings_[i].time_s));
      sides[side] = {solids_[i].modes.get(), phi[side], ring.q, ring.q_dot};
    }
    const impact::Prediction p = impact::predict(spring, 1.0 / inverse_mass, hit.approach_m_s, hit.restitution, sides[0], sides[1]);
    // A shelf has one modal state: while an impact of another group has it, those that strike it meanwhile do so as rigid bodies.
    const bool is_free =
        !(rings(hit.a) && in_ringing_[static_cast<std::size_t>(hit.a)]) && !(rings(hit.b) && in_ringing_[static_cast<std::size_t>(hit.b)]);
    integrate = integrate || (!p.is_enough && is_free);
    if (p.restitution < hit.restitution) {
      hit.restitution = p.restitution;
      points[n].wanted = (hit.restitution * hit.approach_m_s) * hit.touch.normal;
    }
  }
  return integrate;
}

/// What a body on joints does in an impact.
void Space::put_on_joints(int body, impact::Body& b) const {
  const Linked* linked = find_linked(body);
  if (linked == nullptr) return;
  const int member = get_member(body);
  std::vector<joints::Spatial> rates;
  linked->mechanism->find_accelerations(linked->now, rates);
  b.on_joints = true;
  b.mobility = calc_own_mobility(*linked, member);
  b.velocity_m_s = states_[static_cast<std::size_t>(body)].velocity;
  b.spin_rad_s = placed_[static_cast<std::size_t>(body)].spin;
  b.acceleration_m_s2 = rates[static_cast<std::size_t>(member)].linear;
  b.spin_acceleration_rad_s2 = rates[static_cast<std::size_t>(member)].angular;
}

impact::Body Space::make_struck(int body, double time_s) {
  const auto i = static_cast<std::size_t>(body);
  impact::Body b;
  b.centre_m = states_[i].centre;
  if (moves(body)) {
    b.mass_kg = solids_[i].mass_kg;
    b.inertia_kg_m2 = placed_[i].rotation * (solids_[i].inertia_kg_m2 * transpose(placed_[i].rotation));
    b.velocity_m_s = states_[i].velocity;
    b.spin_rad_s = placed_[i].spin;
    b.acceleration_m_s2 = gravity_;
    b.spin_acceleration_rad_s2 = placed_[i].inverse_inertia * cross(states_[i].momentum, placed_[i].spin);
    put_on_joints(body, b);
  }
  if (rings(body)) {
    const Ring& ring = ring_until(body, std::max(time_s, rings_[i].time_s));
    b.modes = solids_[i].modes.get();
    b.q = ring.q;
    b.q_dot = ring.q_dot;
  }
  return b;
}

/// Shapes of a body in world axes.
std::vector<double> Space::find_shape(int body, const std::vector<double>& shape) const {
  std::vector<double> world(shape.size());
  const Mat3& r = placed_[static_cast<std::size_t>(body)].rotation;
  for (std::size_t m = 0; m + 2 < shape.size(); m += 3) {
    const Vec3 v = r * Vec3{shape[m], shape[m + 1], shape[m + 2]};
    world[m] = v[0];
    world[m + 1] = v[1];
    world[m + 2] = v[2];
  }
  return world;
}

/// Does it carry, or is it about to, outside of all impacts?
bool Space::is_resting(const Contact& c) const { return !c.presses && c.cord < 0 && c.touch.gap_m <= kTouch; }

/// What is struck and leans on something else is struck with what stands behind it: adds the contacts that rest on the bodies of `order`,
/// and on the bodies that these lean on. False where they are too many, or bodies on joints or another impact are among them: the rigid
/// impact stands.
bool Space::add_resting(const std::vector<Ref>& taken, const std::vector<Hit>& hits, double time_s, std::vector<std::size_t>& order) const {
  std::vector<char> is_taken(hits.size(), 0);
  std::set<int> struck;
  for (const std::size_t n : order) {
    is_taken[n] = 1;
    for (const int body : {hits[n].a, hits[n].b})
      if (moves(body) && !has_impact(body)) struck.insert(body);
  }
  const std::size_t hit = order.size();
  for (bool grows = true; std::exchange(grows, false);)
    for (std::size_t n = 0; n < taken.size(); ++n) {
      const Contact& c = taken[n].get();
      if (is_taken[n] || !is_resting(c)) continue;
      const bool leans =
          std::any_of(struck.begin(), struck.end(), [&](int body) { return hang_together(body, c.a) || hang_together(body, c.b); });
      if (!leans) continue;
      for (const int body : {c.a, c.b}) {
        if (body < 0) continue;
        if (find_linked(body) != nullptr || in_ringing_[static_cast<std::size_t>(body)]) return false;
        if (paces_[static_cast<std::size_t>(body)].crowded_until_s > time_s) return false;
        if (moves(body)) struck.insert(body);
      }
      is_taken[n] = 1;
      order.push_back(n);
      grows = true;
    }
  std::sort(order.begin(), order.end());
  return order.size() == hit || order.size() <= kMaxTogether;
}

/// Begins an impact with modes, or lets the hits join one that is on its way. False where there are too many points: the rigid impact
/// stands.
bool Space::begin_ringing(const std::vector<Ref>& taken, std::vector<Hit>& hits, double time_s) {
  std::vector<std::size_t> order;
  for (std::size_t n = 0; n < hits.size(); ++n)
    if (hits[n].approach_m_s > kSlowest && !hits[n].is_cord) order.push_back(n);
  if (order.empty()) return false;
  std::vector<std::size_t> resting = order;
  if (!add_resting(taken, hits, time_s, resting)) return false;
  std::vector<char> rests(hits.size(), 1);
  for (const std::size_t n : order) rests[n] = 0;
  order = std::move(resting);
  // Of bodies on the same joints one takes part.
  std::map<const Linked*, int> struck;
  for (const std::size_t n : order)
    for (const int body : {hits[n].a, hits[n].b}) {
      const Linked* linked = moves(body) ? find_linked(body) : nullptr;
      if (linked == nullptr) continue;
      const int first = linked->ringing >= 0 ? linked->bodies[static_cast<std::size_t>(linked->ringing)] : body;
      if (struck.emplace(linked, first).first->second != body) return false;
    }
  Ringing* joined = nullptr;
  // A hit on a body (such as a shelf) that is in an impact of another group stays out of this one.
  std::erase_if(order, [&](std::size_t n) {
    return find_own_ringing(hits[n]) == nullptr && (find_ringing(hits[n].a) != nullptr || find_ringing(hits[n].b) != nullptr);
  });
  if (std::all_of(order.begin(), order.end(), [&](std::size_t n) { return rests[n] != 0; })) return false;  // all hits stay out
  // A body is in one impact at a time: those of all that meet here become one.
  for (const std::size_t n : order)
    for (const int body : {hits[n].a, hits[n].b}) {
      Ringing* found = find_ringing(body);
      if (found == nullptr || found == joined) continue;
      if (joined == nullptr)
        joined = found;
      else
        end_ringing(*found, time_s);  // what it has in its springs is lost
    }
  const bool leans = std::any_of(order.begin(), order.end(), [&](std::size_t n) { return rests[n] != 0; });
  const std::size_t together = order.size() + (joined != nullptr ? joined->presses.size() : 0);
  if (leans && together > kMaxTogether) return false;
  if (!leans && together > kMaxPresses) {
    if (joined != nullptr) {
      end_ringing(*joined, time_s);
      joined = nullptr;
    }
    if (order.size() > kMaxPresses) {
      std::stable_sort(order.begin(), order.end(),
                       [&](std::size_t x, std::size_t y) { return hits[x].approach_m_s > hits[y].approach_m_s; });
      order.resize(kMaxPresses);
      std::sort(order.begin(), order.end());
    }
  }
  const bool is_new = joined == nullptr;
  if (is_new) {
    ringings_.emplace_back();
    joined = &ringings_.back();
    joined->start_s = time_s;
  }
  Ringing& ringing = *joined;
  std::vector<impact::Body> bodies;
  const auto find_index = [&](int body) {
    if (body < 0 || (!moves(body) && !rings(body))) return -1;
    const auto at = std::find(ringing.bodies.begin(), ringing.bodies.end(), body);
    if (at != ringing.bodies.end()) return static_cast<int>(at - ringing.bodies.begin());
    ringing.bodies.push_back(body);
    in_ringing_[static_cast<std::size_t>(body)] = 1;
    if (Linked* linked = moves(body) ? find_linked(body) : nullptr; linked != nullptr) linked->ringing = get_member(body);
    const impact::Body struck = make_struck(body, time_s);
    if (is_new) {
      bodies.push_back(struck);
      return static_cast<int>(bodies.size()) - 1;
    }
    return ringing.impact->join(struck);
  };
  std::vector<impact::Contact> contacts;
  std::list<std::vector<double>> shapes;  // kept until the impact has them
  for (const std::size_t n : order) {
    Hit& hit = hits[n];
    Contact& c = taken[n].get();
    Press press;
    press.a = hit.a;
    press.b = hit.b;
    const int stands = moves(hit.a) ? hit.a : hit.b;
    const auto s = static_cast<std::size_t>(stands);
    press.station = transpose(placed_[s].rotation) * (hit.touch.where_m - states_[s].centre);
    impact::Contact contact;
    int a = find_index(hit.a), b = find_index(hit.b);
    contact.where_m = hit.touch.where_m;
    contact.normal = hit.touch.normal;
    // Surfaces are where the motion of the rigid bodies has them; what modes lift or lower there is small, and must not press a spring.
    contact.rests = rests[n] != 0;
    contact.gap_m = contact.rests ? 0.0 : std::max(hit.touch.gap_m, 0.0);
    contact.spring = make_spring(hit.touch, hit.a, hit.b);
    contact.restitution = calc_pair_restitution(hit.a, hit.b);
    contact.is_limit = true;
    contact.friction = calc_pair_friction(hit.a, hit.b);
    press.place_a = find_place(hit, true);
    if (rings(hit.a)) {
      press.shape_a = solid(hit.a).find_shape(press.place_a);
      shapes.push_back(find_shape(hit.a, press.shape_a));
      contact.shape_a = shapes.back();
    }
    if (hit.b >= 0) press.place_b = find_place(hit, false);
    if (rings(hit.b)) {
      press.shape_b = solid(hit.b).find_shape(press.place_b);
      shapes.push_back(find_shape(hit.b, press.shape_b));
      contact.shape_b = shapes.back();
    }
    if (a < 0) {
      // What neither moves nor rings is b of the impact: the contact is turned round.
      std::swap(a, b);
      contact.normal = -1.0 * contact.normal;
      std::swap(contact.shape_a, contact.shape_b);
      std::swap(press.a, press.b);
      std::swap(press.place_a, press.place_b);
      std::swap(press.shape_a, press.shape_b);
    }
    contact.a = a;
    contact.b = b;
    c.presses = true;
    c.touching = false;
    c.impulse = c.couple = {};
    press.waiting.a = press.a;
    press.waiting.b = press.b;
    press.waiting.place_a = press.place_a;
    press.waiting.place_b = press.place_b;
    ringing.presses.push_back(std::move(press));
    if (is_new)
      contacts.push_back(contact);
    else
      ringing.impact->join(contact);
  }
  if (is_new) ringing.impact = std::make_unique<impact::Impact>(std::move(bodies), std::move(contacts));
  ++costs_.impacts;
  return true;
}

/// An impact with modes has no other contacts than its own: where one of its bodies comes to touch something slowly, it ends.
void Space::release_what_rests(const Island& island) {
  if (ringings_.empty()) return;
  for (const Pair* pair : island.pairs)
    for (const Contact& c : pair->contacts) {
      if (!is_resting(c)) continue;
      for (const int body : {pair->a, pair->b}) {
        Ringing* ringing = moves(body) ? find_ringing(body) : nullptr;
        if (ringing != nullptr && std::abs(calc_approach(c)) <= kSlowest) end_ringing(*ringing, time_s_);
      }
    }
}

/// Moves the impacts with modes of a group on to a time. `movers_` says what gravity and the other contacts do to their bodies in a step,
/// of which `part_s` is made.
void Space::advance_ringings(const Island& island, double to_s, double part_s, double step_s) {
  for (Ringing& ringing : ringings_) {
    const bool is_here = std::any_of(ringing.bodies.begin(), ringing.bodies.end(), [&](int body) {
      return moves(body) && std::find(island.bodies.begin(), island.bodies.end(), body) != island.bodies.end();
    });
    if (!is_here || !(part_s > 0.0)) continue;
    std::vector<impact::Body> bodies = ringing.impact->get_bodies();
    // A body that slept when it was struck has come to move, or belongs to another group: the impact cannot continue as it was.
    bool is_whole = true;
    for (std::size_t k = 0; k < bodies.size(); ++k) {
      const int body = ringing.bodies[k];
      is_whole = is_whole && moves(body) == (bodies[k].mass_kg > 0.0) && (!moves(body) || index_[static_cast<std::size_t>(body)] >= 0);
    }
    if (!is_whole) {
      release(ringing, to_s);  // its bodies stay where they are for this part
      continue;
    }
    std::vector<joints::Spatial> pulls(bodies.size());
    for (std::size_t k = 0; k < bodies.size(); ++k) {
      const int body = ringing.bodies[k];
      if (!moves(body)) continue;
      const auto i = static_cast<std::size_t>(body);
      const Mover& mover = movers_[static_cast<std::size_t>(index_[i])];
      impact::Body& b = bodies[k];
      b.centre_m = states_[i].centre;
      b.inertia_kg_m2 = placed_[i].rotation * (solids_[i].inertia_kg_m2 * transpose(placed_[i].rotation));
      b.acceleration_m_s2 = gravity_;
      b.spin_acceleration_rad_s2 = placed_[i].inverse_inertia * cross(states_[i].momentum, placed_[i].spin);
      put_on_joints(body, b);
      // What cords and other contacts do acts as long as the impact continues in this part, whose own steps may be longer.
      const Vec3 free = b.on_joints ? free_velocity_[static_cast<std::size_t>(index_[i])] : states_[i].velocity + step_s * gravity_;
      pulls[k] = {(1.0 / step_s) * (mover.velocity - free),
                  (1.0 / step_s) * (mover.spin - free_spin_[static_cast<std::size_t>(index_[i])])};
      b.acceleration_m_s2 = b.acceleration_m_s2 + pulls[k].linear;
      b.spin_acceleration_rad_s2 = b.spin_acceleration_rad_s2 + pulls[k].angular;
    }
    std::vector<impact::Contact> contacts;
    std::list<std::vector<double>> shapes;
    for (std::size_t k = 0; k < ringing.presses.size(); ++k) {
      const Press& press = ringing.presses[k];
      impact::Contact contact;
      const auto find_index = [&](int body) {
        const auto at = std::find(ringing.bodies.begin(), ringing.bodies.end(), body);
        return at == ringing.bodies.end() ? -1 : static_cast<int>(at - ringing.bodies.begin());
      };
      contact.a = find_index(press.a);
      contact.b = press.b >= 0 ? find_index(press.b) : -1;
      const int stands = moves(press.a) ? press.a : press.b;
      const auto s = static_cast<std::size_t>(stands);
      contact.where_m = states_[s].centre + placed_[s].rotation * press.station;
      contact.normal = ringing.impact->get_contact(static_cast<int>(k)).normal;
      contact.friction = ringing.impact->get_contact(static_cast<int>(k)).friction;
      contact.spring = ringing.impact->get_contact(static_cast<int>(k)).spring;
      contact.restitution = ringing.impact->get_contact(static_cast<int>(k)).restitution;
      if (!press.shape_a.empty()) {
        shapes.push_back(find_shape(press.a, press.shape_a));
        contact.shape_a = shapes.back();
      }
      if (!press.shape_b.empty()) {
        shapes.push_back(find_shape(press.b, press.shape_b));
        contact.shape_b = shapes.back();
      }
      contacts.push_back(contact);
    }
    ringing.impact->update(bodies, contacts);
    const double from_s = ringing.start_s;
    const double begun_s = ringing.impact->get_time();
    const bool ended = ringing.impact->advance(to_s - from_s);
    bodies = ringing.impact->get_bodies();
    for (std::size_t k = 0; k < bodies.size(); ++k) {
      const int body = ringing.bodies[k];
      if (!moves(body)) continue;
      if (Linked* linked = find_linked(body); linked != nullptr) {
        advance_linked_ringing(*linked, bodies[k], ringing.impact->get_time() - begun_s, step_s);
        continue;
      }
      State& s = states_[static_cast<std::size_t>(body)];
      s.velocity = bodies[k].velocity_m_s;
      s.centre = s.centre + bodies[k].moved_m;
      s.rotation = normalise(multiply(make_turn(bodies[k].turned_rad), s.rotation));
      const Mat3 rotation = make_rotation(s.rotation);
      s.momentum = rotation * (solid(body).inertia_kg_m2 * (transpose(rotation) * bodies[k].spin_rad_s));
    }
    keep_pulses(ringing);
    // Once a window: pieces of a small step each would be many.
    if (to_s >= window_end_s_ - 1e-9)
      for (Press& press : ringing.presses) hand_out_forces(press);
    if (!ended && to_s - from_s <= kLongest) continue;
    // It has gone beyond the end of the part, and so did the pulls.
    const double beyond_s = from_s + ringing.impact->get_time() - to_s;
    const std::vector<int> ringing_bodies = ringing.bodies;
    release(ringing, to_s);
    for (std::size_t k = 0; k < bodies.size(); ++k)
      if (beyond_s > 0.0 && moves(ringing_bodies[k])) take_pull_back(ringing_bodies[k], pulls[k], beyond_s, step_s);
  }
  ringings_.remove_if([](const Ringing& r) { return r.impact == nullptr; });
}

/// Undoes what cords did to a body in the last moments of a step.
void Space::take_pull_back(int body, const joints::Spatial& pull, double time_s, double step_s) {
  if (pull.linear == Vec3{} && pull.angular == Vec3{}) return;
  if (Linked* linked = find_linked(body); linked != nullptr) {
    if (!linked->push.empty())
      linked->now = linked->mechanism->move(linked->now, linked->push, -time_s / step_s, 0.5 * time_s * time_s / step_s);
    place_linked(*linked);
    return;
  }
  const auto i = static_cast<std::size_t>(body);
  State& s = states_[i];
  s.velocity = s.velocity - time_s * pull.linear;
  s.centre = s.centre + (0.5 * time_s * time_s) * pull.linear;
  const Mat3 inertia = placed_[i].rotation * (solids_[i].inertia_kg_m2 * transpose(placed_[i].rotation));
  s.momentum = s.momentum - time_s * (inertia * pull.angular);
  place_body(body);
}

/// Takes the forces of an impact since the last time into the frames of its bodies, as they are now.
void Space::keep_pulses(Ringing& ringing) {
  for (const impact::Pulse& pulse : ringing.impact->take_pulses()) {
    Press& press = ringing.presses[static_cast<std::size_t>(pulse.contact)];
    Forces& forces = press.waiting;
    const double start_s = ringing.start_s + pulse.start_s;
    // A contact that was open for a while begins again.
    if (!forces.on_a.empty() &&
        std::abs(start_s - forces.time_s - forces.step_s * static_cast<double>(forces.on_a.size())) > 0.5 * forces.step_s)
      hand_out_forces(press);
    if (forces.on_a.empty()) forces.time_s = start_s;
    forces.step_s = pulse.step_s;
    const auto to_mesh = [&](int body) { return transpose(placed_[static_cast<std::size_t>(body)].rotation); };
    const Mat3 to_a = to_mesh(press.a), to_b = press.b >= 0 ? to_mesh(press.b) : Mat3{};
    for (const Vec3& impulse : pulse.impulse_n_s) {
      forces.on_a.push_back(to_a * impulse);
      if (press.b >= 0) forces.on_b.push_back(to_b * (-1.0 * impulse));
    }
  }
}

void Space::hand_out_forces(Press& press) {
  if (press.waiting.on_a.empty()) return;
  Forces next = press.waiting;
  next.on_a.clear();
  next.on_b.clear();
  next.continues = true;
  forces_.push_back(std::exchange(press.waiting, std::move(next)));
}

/// Gives the bodies of an impact their modal states back. It may be ahead of `time_s` by a part of its step.
void Space::release(Ringing& ringing, double time_s) {
  keep_pulses(ringing);
  for (Press& press : ringing.presses) hand_out_forces(press);
  const std::vector<impact::Body> bodies = ringing.impact->get_bodies();
  const double reached_s = ringing.start_s + ringing.impact->get_time();
  const impact::Books books = ringing.impact->get_books();
  lost_j_ += books.dissipated_modes + books.dissipated_contact + books.dissipated_friction + books.above_band + books.spring;
  for (std::size_t k = 0; k < bodies.size(); ++k) {
    const int body = ringing.bodies[k];
    const auto i = static_cast<std::size_t>(body);
    in_ringing_[i] = 0;
    if (rings(body)) rings_[i] = {bodies[k].q, bodies[k].q_dot, reached_s};
    if (Linked* linked = find_linked(body); linked != nullptr && moves(body)) {
      linked->ringing = -1;
      if (reached_s > time_s) linked->now = fly_linked(*linked, linked->now, time_s - reached_s);
      place_linked(*linked);
      continue;
    }
    if (moves(body) && reached_s > time_s) states_[i] = fly(solids_[i], states_[i], gravity_, time_s - reached_s);
    place_body(body);
  }
  for (auto& [key, pair] : pairs_)
    for (Contact& c : pair.contacts)
      for (const Press& press : ringing.presses) {
        const bool same = (press.a == key.first && press.b == key.second) || (press.b == key.first && press.a == key.second);
        if (!same || !c.presses) continue;
        c.presses = c.touching = false;
        // Where its modes yielded the body stands lower than it would on what is rigid.
        pair.sag_m = std::max(pair.sag_m, -c.touch.gap_m);
      }
  ringing.impact = nullptr;
  ringing.bodies.clear();
}

void Space::end_ringing(Ringing& ringing, double time_s) {
  release(ringing, time_s);
  ringings_.remove_if([](const Ringing& r) { return r.impact == nullptr; });
}

Books Space::calc_books() const {
  Books books;
  for (const Linked& linked : linked_) books.lost_j += linked.now.lost_j;
  for (std::size_t i = 0; i < solids_.size(); ++i) {
    books.motion_j += rigid::calc_energy(solids_[i], states_[i], gravity_);
    if (!solids_[i].modes || rings_[i].q.empty() || in_ringing_[i]) continue;
    std::vector<double> q = rings_[i].q, q_dot = rings_[i].q_dot;
    const double before = solids_[i].modes->calc_energy(q, q_dot);
    if (before > 0.0 && time_s_ > rings_[i].time_s) solids_[i].modes->move_freely(q, q_dot, time_s_ - rings_[i].time_s);
    const double now = solids_[i].modes->calc_energy(q, q_dot);
    books.modes_j += now;
    books.lost_j += before - now;
  }
  for (const Ringing& ringing : ringings_) {
    const impact::Books inside = ringing.impact->get_books();
    books.modes_j += inside.modal;
    books.springs_j += inside.spring;
    books.lost_j += inside.dissipated_modes + inside.dissipated_contact + inside.dissipated_friction + inside.above_band;
  }
  books.lost_j += lost_j_;
  return books;
}

}  // namespace carillon::rigid
