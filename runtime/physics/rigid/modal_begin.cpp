// Method: if modes would receive less than 2 % of the energy, the rigid impact and the Hertz pulse are used; otherwise a modal impact
// begins, or a current one gets additional contacts.
// Source: runtime/physics/impact/predict.hpp; docs/decisions/impact.md.
#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <span>

#include "runtime/physics/impact/predict.hpp"
#include "runtime/physics/rigid/limits.hpp"
#include "runtime/physics/rigid/modal_impact.hpp"

namespace carillon::rigid {
namespace {

constexpr int kMaxHits = 8;                // per impact, with its compressed contacts
constexpr double kMinEarlySpeedMS = 1e-2;  // m/s; minimum approach for an impact before contact of the rigid surfaces
constexpr int kMaxContacts = 12;           // including resting contacts

/// (n) shape values along a direction.
std::vector<double> project(std::span<const double> shape, const Vec3& along) {
  std::vector<double> phi(shape.size() / 3);
  for (int m = 0; double& value : phi) {
    value = shape[m] * along[0] + shape[m + 1] * along[1] + shape[m + 2] * along[2];
    m += 3;
  }
  return phi;
}

/// Bound of the displacement by modes with these shape values and amplitudes.
double calc_displacement(const std::vector<double>& phi, const std::vector<double>& amplitudes) {
  double sum = 0.0;
  for (std::size_t m = 0; m < phi.size(); ++m) sum += std::abs(phi[m]) * amplitudes[m];
  return sum;
}

impact::Spring make_spring(const Bodies& bodies, const Hit& hit) {
  return {.stiffness =
              impact::calc_hertz_stiffness(bodies.calc_compliance(hit.a, hit.b), bodies.calc_contact_radius(hit.touch, hit.a, hit.b))};
}

}  // namespace

/// The current impact of one of the hit's bodies. None if a body is in an impact that moves bodies outside the island.
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

bool ModalImpacts::predict(const Step& step, Collision& collision) {
  bool integrate = false;
  for (int n = 0; Hit & hit : collision.hits) {
    const Contact& c = collision.contacts[n].get();
    Point& point = collision.points[n++];
    if (!(hit.approach_m_s > kMinImpactSpeedMS) || c.is_closed()) continue;
    const bool is_owned = !hit.is_cord && find_own(step, hit) != nullptr;
    integrate = integrate || is_owned;
    if (hit.is_cord || (!bodies_.has_modes(hit.a) && !bodies_.has_modes(hit.b))) continue;
    if (!is_owned && !(hit.restitution > 0.0)) continue;  // gravity keeps the surfaces together (rigid_impact.cpp)
    const double inverse_mass = dot(hit.touch.normal, calc_mobility(collision.movers, point) * hit.touch.normal);
    std::vector<double> phi[2];
    impact::Side sides[2];
    // A body such as a shelf has one modal state: while an impact of another island owns it, further strikes on it are rigid.
    bool is_free = true;
    for (const int side : {0, 1}) {
      const int body = side == 0 ? hit.a : hit.b;
      if (!bodies_.has_modes(body)) continue;
      phi[side] = project(find_shape(bodies_, hit, side == 0), transpose(bodies_.placed(body).rotation) * hit.touch.normal);
      if (bends_far(body, phi[side], 1.0 / inverse_mass, hit.approach_m_s)) hit.bends = true;
      if (bodies_.is_in_impact(body)) {
        is_free = false;
        continue;
      }
      const ModalState& state = states_.advance(body, bodies_.get_time());
      sides[side] = {bodies_.solid(body).modes.get(), phi[side], state.q, state.q_dot};
    }
    if (is_owned) continue;
    const impact::Prediction p =
        impact::predict(make_spring(bodies_, hit), 1.0 / inverse_mass, hit.approach_m_s, hit.restitution, sides[0], sides[1]);
    integrate = integrate || (!p.is_enough && is_free && may_begin_);
    if (p.restitution < hit.restitution) {
      hit.restitution = p.restitution;
      point.wanted = (hit.restitution * hit.approach_m_s) * hit.touch.normal;
    }
  }
  return integrate && std::none_of(collision.hits.begin(), collision.hits.end(), [](const Hit& hit) { return hit.bends; });
}

/// True if the modes of a soft body, with shape values `phi` along the normal of a hit, may deflect it beyond the linear range: by their
/// present swing, and by a reduced mass [kg] with that speed.
bool ModalImpacts::bends_far(int body, const std::vector<double>& phi, double mass_kg, double speed_m_s) {
  const double most_m = bodies_.solid(body).max_bend_m;
  if (std::isinf(most_m)) return false;
  const impact::Modes& modes = *bodies_.solid(body).modes;
  double bend_m = 0.0;
  if (!bodies_.is_in_impact(body)) {
    const ModalState& state = states_.advance(body, bodies_.get_time());
    bend_m = calc_displacement(phi, calc_amplitudes(modes, state.q, state.q_dot));
  }
  for (std::size_t m = 0; m < phi.size(); ++m)
    if (const double omega = modes.get_omega()[m]; omega > 0.0) bend_m += std::abs(phi[m]) * std::sqrt(mass_kg) * speed_m_s / omega;
  return bend_m > most_m;
}

/// A supported body is struck together with its supports: adds the resting contacts of the bodies of `order`, and of the bodies that
/// support these. False (rigid impact) if there are too many, or if bodies on joints or another impact are among them.
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
      if (is_taken[n] || !c.carries()) continue;
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
  return order.size() == hit_count || order.size() <= kMaxContacts;
}

/// True if two members of one articulation are struck.
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
    if (!(hits[n].approach_m_s > kMinImpactSpeedMS) || hits[n].is_cord) continue;
    order.push_back(n);
    rests[n] = 0;
  }
  if (order.empty() || !add_resting(collision, instants, order) || shares_articulations(hits, order)) return std::nullopt;
  // A hit on a body (such as a shelf) that is in an impact of another island is left out.
  std::erase_if(order,
                [&](int n) { return find_own(step, hits[n]) == nullptr && (find(hits[n].a) != nullptr || find(hits[n].b) != nullptr); });
  if (std::all_of(order.begin(), order.end(), [&](int n) { return rests[n] != 0; })) return std::nullopt;  // all hits are left out
  return selection;
}

/// The impact that the selected contacts join; the impacts of all bodies involved are merged. None: they begin a new one; if there are too
/// many contacts, the current impacts end and the fastest hits begin it. False: too many resting contacts.
bool ModalImpacts::join(const std::vector<Hit>& hits, Selection& selection, TouchSets& touches, ModalImpact*& joined) {
  std::vector<int>& order = selection.order;
  for (const int n : order)
    for (const int body : {hits[n].a, hits[n].b}) {
      ModalImpact* found = find(body);
      if (found == nullptr || found == joined) continue;
      if (joined == nullptr)
        joined = found;
      else
        end(*found, touches);  // the energy of its springs is lost
    }
  const bool leans = std::any_of(order.begin(), order.end(), [&](int n) { return selection.rests[n] != 0; });
  auto together = order.size();
  for (int k = 0; joined != nullptr && k < static_cast<int>(joined->contacts.size()); ++k)
    together += joined->impact->get_compression(k) > 0.0 ? 1 : 0;
  if (leans) return together <= kMaxContacts;
  if (together <= kMaxHits) return true;
  if (joined != nullptr) end(*std::exchange(joined, nullptr), touches);
  if (order.size() > kMaxHits) {
    std::stable_sort(order.begin(), order.end(), [&](int x, int y) { return hits[x].approach_m_s > hits[y].approach_m_s; });
    order.resize(kMaxHits);
    std::sort(order.begin(), order.end());
  }
  return true;
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

/// Index of a body in an impact; adds it if necessary; -1: static. For an impact that has not begun the body is added to `made`.
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

/// Separation of the surfaces at a contact by the modes of both bodies [m].
double ModalImpacts::calc_yield(const impact::Contact& contact, const std::vector<impact::Body>& bodies) {
  double yield = 0.0;
  for (const bool is_a : {true, false}) {
    const std::span<const double> shape = is_a ? contact.shape_a : contact.shape_b;
    if (shape.empty()) continue;
    const std::vector<double>& q = bodies[is_a ? contact.a : contact.b].q;
    const std::vector<double> phi = project(shape, (is_a ? 1.0 : -1.0) * contact.normal);
    for (std::size_t m = 0; m < q.size(); ++m) yield += q[m] * phi[m];
  }
  return yield;
}

/// Converts a touch to a contact of an impact, open if the deformed surfaces are separated. Overlap left by an earlier impact (`sag_m`) or
/// a missed touch does not load the spring.
void ModalImpacts::add_contact(ModalImpact& modal, Contact& touch, double sag_m, Hit& hit, bool rests, Made& made) {
  impact::Contact spring;
  spring.a = add_body(modal, hit.a, made.bodies);
  spring.b = add_body(modal, hit.b, made.bodies);
  ModalContact contact;
  contact.touch = touch.touch.id;
  contact.forces.a = hit.a;
  contact.forces.b = hit.b;
  contact.station = find_station(hit.a, hit.b, hit.touch);
  contact.forces.place_a = find_place(bodies_, hit, true);
  if (bodies_.has_modes(hit.a)) contact.shape_a = find_shape(bodies_, hit, true);
  if (hit.b >= 0) contact.forces.place_b = find_place(bodies_, hit, false);
  if (bodies_.has_modes(hit.b)) contact.shape_b = find_shape(bodies_, hit, false);
  spring.where_m = hit.touch.where_m;
  spring.normal = hit.touch.normal;
  spring.rests = rests;
  spring.spring = contact.spring = make_spring(bodies_, hit);
  contact.is_sharp = !hit.touch.smooth;
  spring.restitution = bodies_.calc_restitution(hit.a, hit.b);
  spring.is_limit = true;
  spring.friction = bodies_.calc_friction(hit.a, hit.b);
  if (!contact.shape_a.empty()) spring.shape_a = made.shapes.emplace_back(turn_to_world(hit.a, contact.shape_a));
  if (!contact.shape_b.empty()) spring.shape_b = made.shapes.emplace_back(turn_to_world(hit.b, contact.shape_b));
  if (spring.a < 0) {
    // Static bodies are side b.
    std::swap(spring.a, spring.b);
    spring.normal = -1.0 * spring.normal;
    std::swap(spring.shape_a, spring.shape_b);
    std::swap(contact.forces.a, contact.forces.b);
    std::swap(contact.forces.place_a, contact.forces.place_b);
    std::swap(contact.shape_a, contact.shape_b);
  }
  const double gap_m = rests ? std::min(hit.touch.gap_m, 0.0) : hit.touch.gap_m;
  const double open_m = gap_m + calc_yield(spring, modal.impact != nullptr ? modal.impact->get_bodies() : made.bodies);
  spring.gap_m = std::max(open_m, 0.0);
  spring.yielded_m = std::clamp(-open_m, 0.0, sag_m);
  touch.press();
  modal.contacts.push_back(std::move(contact));
  if (modal.impact != nullptr)
    modal.impact->join(spring);
  else
    made.springs.push_back(spring);
}

/// An ended impact, and the modes of its bodies, may be ahead by a part of its step: the next impact begins at that time. Moves the bodies
/// there, or the modes back; returns the time.
double ModalImpacts::fly_to_modes(const std::vector<Hit>& hits, const std::vector<int>& order) {
  const double now_s = bodies_.get_time();
  double start_s = now_s;
  std::set<int> moving;
  for (const int n : order)
    for (const int body : {hits[n].a, hits[n].b}) {
      if (bodies_.has_modes(body)) start_s = std::max(start_s, states_.advance(body, now_s).time_s);
      if (bodies_.moves(body) && bodies_.find_articulation(body) == nullptr) moving.insert(body);
    }
  if (!(start_s > now_s)) return now_s;
  const bool is_fast = std::any_of(order.begin(), order.end(), [&](int n) {  // they would fly into each other
    return bodies_.calc_approach(hits[n].touch, hits[n].a, hits[n].b) * (start_s - now_s) > kMaxDepthM;
  });
  if (is_fast) {
    for (const int n : order)
      for (const int body : {hits[n].a, hits[n].b})
        if (bodies_.has_modes(body)) states_.turn_back(body, now_s);
    return now_s;
  }
  for (const int body : moving) {
    bodies_.state(body) = fly(bodies_.solid(body), bodies_.state(body), bodies_.gravity(), start_s - now_s);
    bodies_.place(body);
  }
  return start_s;
}

/// Bound of the displacement of both surfaces at a touch by modes; 0 for bodies that the touch would bend far.
double ModalImpacts::calc_swing(const Contact& touch, double approach_m_s) {
  Hit hit{.a = touch.a, .b = touch.b, .touch = touch.touch, .triangles = touch.triangles};
  double swing = 0.0;
  for (const bool is_a : {true, false}) {
    const int body = is_a ? hit.a : hit.b;
    if (!bodies_.has_modes(body)) continue;
    const std::vector<double> phi = project(find_shape(bodies_, hit, is_a), transpose(bodies_.placed(body).rotation) * hit.touch.normal);
    if (bends_far(body, phi, bodies_.solid(body).mass_kg, approach_m_s)) return 0.0;
    const ModalState& state = states_.advance(body, bodies_.get_time());
    swing += calc_displacement(phi, calc_amplitudes(*bodies_.solid(body).modes, state.q, state.q_dot));
  }
  return swing;
}

/// True if the swing of the pair's surfaces is relevant and its bodies are in no impact.
bool ModalImpacts::may_begin_early(const Step& step, const Pair& pair, const Instants& instants) const {
  if (pair.cord >= 0 || !step.has(pair) || bodies_.get_swing(pair.a) + bodies_.get_swing(pair.b) <= kMaxDepthM) return false;
  const auto is_free = [&](int body) {
    return body < 0 ||
           (!bodies_.is_in_impact(body) && bodies_.find_articulation(body) == nullptr && !instants.is_crowded(body, bodies_.get_time()));
  };
  return is_free(pair.a) && is_free(pair.b);
}

bool ModalImpacts::begin_early(const Step& step, double length_s, const Instants& instants) {
  if (!may_begin_) return false;
  bool has_begun = false;
  for (Pair* pair : step.island().pairs) {
    if (!may_begin_early(step, *pair, instants)) continue;
    std::vector<Contact*> early;
    std::vector<Hit> hits;
    std::vector<int> order;
    for (Contact& c : pair->contacts) {
      const double approach = bodies_.calc_approach(c.touch, c.a, c.b);
      if (c.presses || c.is_closed() || approach < kMinEarlySpeedMS) continue;
      const double open_m = c.touch.gap_m - (approach + norm(bodies_.gravity()) * length_s) * length_s;
      if (open_m > bodies_.get_swing(c.a) + bodies_.get_swing(c.b)) continue;
      if (const double swing_m = calc_swing(c, approach); swing_m <= kMaxDepthM || open_m >= swing_m) continue;
      early.push_back(&c);
      order.push_back(static_cast<int>(hits.size()));
      hits.push_back({.a = c.a, .b = c.b, .touch = c.touch, .triangles = c.triangles});
    }
    if (early.empty()) continue;
    has_begun = true;
    ModalImpact& modal = impacts_.emplace_back();
    modal.start_s = fly_to_modes(hits, order);
    Made made;
    for (int n = 0; Contact * c : early) add_contact(modal, *c, pair->sag_m, hits[n++], false, made);
    modal.impact = std::make_unique<impact::Impact>(std::move(made.bodies), std::move(made.springs));
  }
  return has_begun;
}

bool ModalImpacts::begin(const Step& step, Collision& collision, const Instants& instants, TouchSets& touches) {
  std::optional<Selection> selection = select(step, collision, instants);
  ModalImpact* joined = nullptr;
  if (!selection || !join(collision.hits, *selection, touches, joined)) return false;
  const bool is_new = joined == nullptr;
  if (is_new) {
    joined = &impacts_.emplace_back();
    joined->start_s = fly_to_modes(collision.hits, selection->order);
  }
  ModalImpact& modal = *joined;
  Made made;
  for (const int n : selection->order)
    add_contact(modal, collision.contacts[n].get(), collision.contacts[n].pair->sag_m, collision.hits[n], selection->rests[n] != 0, made);
  if (is_new) modal.impact = std::make_unique<impact::Impact>(std::move(made.bodies), std::move(made.springs));
  ++ledger_.costs.impacts;
  return true;
}

}  // namespace carillon::rigid
