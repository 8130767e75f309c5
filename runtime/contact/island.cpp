// Method: event-driven. Between impacts Simbody integrates the motion; after each step the surfaces are tested, and a new touch that
// approaches
//   faster than kSlowest is traced back to its first instant, where all touching points are solved together for their impulses and the
//   velocities jump. Slower touches, and points beside a spot that already rests, are left to a soft force and make no sound. The real
//   contact lasts a Hertz time from the touch on, so its pulse is centred half that time later.
// Source: B. Mirtich, "Impulse-based dynamic simulation of rigid body systems" (1996); J. O'Brien, C. Shen, C. Gatchalian, "Synthesizing
// sounds from
//   rigid-body simulations" (2002), section 4, for what the sound needs of it.
// Deviations: resting contact is a damped spring, not a train of micro-impacts, since those would be heard.
#include "runtime/contact/island.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <tuple>

namespace carillon::contact {
namespace {

using SimTK::dot;
using SimTK::Transform;
using Point = SimTK::Vec3;

constexpr double kSlowest = 1e-3;        // m/s; a touch slower than this is not an impact (a fall from 0.05 um)
constexpr double kLongestHertz = 20e-3;  // s; of calc_hertz_duration
constexpr double kTogether = 1e-4;       // s; touches nearer in time than this are one impact (a Hertz contact lasts about as long)
constexpr double kTouchDepth = 1e-8;     // m; how well the first instant of a touch is found
constexpr double kTouchTime = 2e-7;      // s; the same in time
constexpr double kRollingTime =
    10e-3;  // s; a body that rolls or slides over the corners of its own mesh hops from one to the next so fast ...
constexpr double kRollingSpeed = 0.1;  // m/s; ... and lands on them slower than this: that is the mesh, not the body, and must not be heard
constexpr double kStill = 2e-5;        // m/s; a hundredth of what friction lets creep: a group of bodies slower than this ...
constexpr double kAsleepAfter = 0.05;  // s; ... for so long lies where it lies until another comes near
constexpr double kSamePlace = 2e-4;    // m; a bouncing body comes back to the same place, a rolling one does not

double calc_approach(const Engine& engine, const Snapshot& now, const TouchPoint& touch) {
  return -dot(calc_relative_velocity(now.mobiles, engine.make_impact_point(touch)), touch.normal);
}

}  // namespace

Island::Island(WorldModel world, std::vector<int> members, SurfaceSet& surfaces, double time_s, const std::vector<OldPoint>& recent,
               const std::vector<RestedPoint>& rested, const std::vector<Spot>& spots, const TouchCounts& touches,
               const WorldOptions& options)
    : world_(std::move(world)),
      members_(std::move(members)),
      engine_(world_, surfaces, time_s, options),
      state_(engine_.initial()),
      has_lasting_(options.lasting_contacts),
      audits_(options.audits_energy),
      lasting_(touches) {
  still_since_s_ = time_s;
  const auto find = [&](int body) {
    const auto it = std::lower_bound(members_.begin(), members_.end(), body);
    return it != members_.end() && *it == body ? static_cast<int>(it - members_.begin()) : -1;
  };
  const auto to_own = [&](std::int32_t body) { return body < 0 ? -1 : find(body); };
  for (Spot spot : spots) {
    const bool on_ground = spot.b < 0;
    spot.a = find(spot.a);
    spot.b = to_own(spot.b);
    if (spot.a < 0 || (spot.b < 0 && !on_ground)) continue;
    for (stream::Contact& c : spot.last) {
      c.body = to_own(c.body);
      c.other = to_own(c.other);
    }
    lasting_.spots().push_back(std::move(spot));
  }
  std::vector<RestedPoint> own;
  for (RestedPoint r : rested) {
    const bool on_ground = r.b < 0;
    r.a = find(r.a);
    r.b = to_own(r.b);
    if (r.a >= 0 && (r.b >= 0 || on_ground)) own.push_back(r);
  }
  engine_.set_rested(std::move(own));
  for (const OldPoint& o : recent) {
    const int a = find(o.a), b = o.b < 0 ? -1 : find(o.b);
    if (a >= 0 && (o.b < 0 || b >= 0)) recent_.push_back({a, b, o.in_a, o.time_s});
  }
}

std::vector<OldPoint> Island::find_old(const Snapshot& now, const std::vector<TouchPoint>& touches) const {
  std::vector<OldPoint> old;
  for (const TouchPoint& t : touches) {
    if (calc_approach(engine_, now, t) > -0.5 * kSlowest) old.push_back({t.a, t.b, ~now.poses[t.a] * t.where, state_.time_s});
  }
  return old;
}

/// Does the touch belong to a spot that is in contact anyway, or to a body that rolls?
bool Island::is_old(const TouchPoint& t, const Snapshot& now, double approach) const {
  const Point in_a = ~now.poses[t.a] * t.where;
  const double near = engine_.spot_radius_m(t.a, t.b);
  const auto is_near = [&](const OldPoint& o) { return o.a == t.a && o.b == t.b && (o.in_a - in_a).norm() < near; };
  if (std::any_of(old_.begin(), old_.end(), is_near)) return true;
  if (approach > kRollingSpeed) return false;
  // Only the latest touches count; one of them at the very same place means a bounce.
  bool rolls = false;
  for (const OldPoint& o : recent_) {
    if (!is_near(o)) continue;
    if ((o.in_a - in_a).norm() < kSamePlace) return false;
    rolls = true;
  }
  return rolls;
}

void Island::remember(const Snapshot& now, const std::vector<TouchPoint>& touches) {
  const double time = state_.time_s;
  const auto stale = [&](const OldPoint& o) { return o.time_s < time - kRollingTime; };
  recent_.erase(std::remove_if(recent_.begin(), recent_.end(), stale), recent_.end());
  for (const TouchPoint& t : touches) recent_.push_back({t.a, t.b, ~now.poses[t.a] * t.where, time});
}

std::int64_t Island::calc_body_steps() const {
  return steps_ * std::count_if(world_.bodies.begin(), world_.bodies.end(), [](const BodyModel& body) { return !body.fixed; });
}

/// Touches that were not there when the step began and approach faster than that.
std::vector<TouchPoint> Island::find_fresh(const Snapshot& now, double faster_than) const {
  std::vector<TouchPoint> fresh;
  for (const TouchPoint& t : engine_.find_touches(now.poses)) {
    const double approach = calc_approach(engine_, now, t);
    if (approach > faster_than && !is_old(t, now, approach)) fresh.push_back(t);
  }
  return fresh;
}

/// One step, or less when a fresh touch comes in between: then up to its first instant. It is an impact if it is fast even there (a body
/// set down with no gap gains speed within the step).
Island::Step Island::calc_step(double step_s) {
  double low = 0.0, high = SimTK::Infinity, step = step_s, creep = 2e-6;
  Step touch;
  for (int attempt = 0; attempt < 80 && high - low > kTouchTime; ++attempt) {
    const Snapshot state = engine_.calc_advanced(state_, step);
    ++steps_;
    const auto fresh = find_fresh(state, attempt == 0 ? kSlowest : 0.0);
    if (fresh.empty() && attempt == 0) return {state, false};
    if (fresh.empty()) {
      low = step;
      step = std::min(low + creep, 0.5 * (low + high));
      creep *= 8;
      continue;
    }
    double deepest = 0.0, earlier = 0.0, fastest = 0.0;
    for (const TouchPoint& t : fresh) {
      const double approach = calc_approach(engine_, state, t);
      deepest = std::max(deepest, t.depth_m);
      earlier = std::max(earlier, t.depth_m / approach);
      fastest = std::max(fastest, approach);
    }
    high = step;
    touch = {state, fastest > kSlowest};
    if (deepest <= kTouchDepth) break;
    step = high - earlier + 0.5 * kTouchTime;
    if (step <= low || step >= high) step = 0.5 * (low + high);
  }
  return touch;
}

/// Of a Hertz contact at that place [s].
double Island::calc_duration(int a, int b, const Snapshot& now, const Point& where, const Point& normal, double mass, double speed) const {
  double largest_radius = 0.5 * engine_.surface(a).size_m();
  if (b >= 0) largest_radius = std::min(largest_radius, 0.5 * engine_.surface(b).size_m());
  const Elastic elastic_a = engine_.make_elastic(a, now.poses[a], where, -normal);
  const Elastic elastic_b = engine_.make_elastic(b, b >= 0 ? now.poses[b] : Transform(), where, normal);
  return calc_hertz_duration(elastic_a, elastic_b, mass, speed, largest_radius);
}

/// Does the touch end before the body is back? A rebound whose flight, 2 e v / g, is shorter than the Hertz contact itself is none: weight
/// keeps the surfaces together.
bool Island::leaves_again(const ImpactPoint& p, double approach, const Snapshot& now) const {
  const auto& g = world_.gravity_m_s2;
  const double weight = std::abs(dot(Point(g[0], g[1], g[2]), p.normal));
  const double flight_weight = 2.0 * p.restitution * approach;  // times gravity
  if (approach <= kSlowest || flight_weight > weight * kLongestHertz) return true;
  const double mass = 1.0 / calc_inverse_effective_mass(now.mobiles, p.a, p.b, p.where, p.normal);
  return flight_weight > weight * calc_duration(p.a, p.b, now, p.where, p.normal, mass, approach);
}

/// Solves the impact at the present instant and notes its pulses.
void Island::strike() {
  const Snapshot now = state_;
  // Everything that touches or will within kTogether takes part.
  std::vector<Transform> soon = now.poses;
  for (std::size_t i = 0; i < soon.size(); ++i) {
    const Mobile& m = now.mobiles[i];
    const double turn = m.spin.norm() * kTogether;
    const SimTK::Rotation R = turn > 0.0 ? SimTK::Rotation(turn, SimTK::UnitVec3(m.spin)) : SimTK::Rotation();
    soon[i] = Transform(R * soon[i].R(), m.centre + m.velocity * kTogether + R * (soon[i].p() - m.centre));
  }
  using Key = std::tuple<int, int, std::array<int, 3>>;
  std::map<Key, TouchPoint> together;
  for (const TouchPoint& t : engine_.find_touches(now.poses)) together.emplace(Key{t.a, t.b, t.feature}, t);
  for (TouchPoint t : engine_.find_touches(soon)) {
    place_touch(t, now.poses[t.a], t.b >= 0 ? now.poses[t.b] : Transform());
    together.emplace(Key{t.a, t.b, t.feature}, t);
  }
  std::vector<TouchPoint> touches;
  std::vector<ImpactPoint> points;
  for (const auto& [key, touch] : together) {
    touches.push_back(touch);
    points.push_back(engine_.make_impact_point(touch));
    const double approach = calc_approach(engine_, now, touch);
    if (is_old(touch, now, approach) || !leaves_again(points.back(), approach, now)) points.back().restitution = 0.0;
  }
  remember(now, touches);
  record();
  solve_impact(state_.mobiles, points, kSlowest);
  emit(points, touches, now);
}

/// Gathers the points into spots, strongest first, and notes one pulse a spot and body.
void Island::emit(const std::vector<ImpactPoint>& points, const std::vector<TouchPoint>& touches, const Snapshot& before) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (dot(points[i].impulse, points[i].normal) > 0.0) order.push_back(i);
  }
  std::stable_sort(order.begin(), order.end(), [&](auto i, auto j) { return points[i].impulse.normSqr() > points[j].impulse.normSqr(); });
  std::vector<bool> taken(points.size(), false);
  for (const std::size_t seed : order) {
    if (taken[seed]) continue;
    std::vector<const ImpactPoint*> spot;
    double wait_s = kTogether;
    for (const std::size_t i : order) {
      if (taken[i] || points[i].a != points[seed].a || points[i].b != points[seed].b) continue;
      if ((points[i].where - points[seed].where).norm() > engine_.spot_radius_m(points[i].a, points[i].b)) continue;
      taken[i] = true;
      spot.push_back(&points[i]);
      const double wait = points[i].approach_m_s > kSlowest ? -touches[i].depth_m / points[i].approach_m_s : 0.0;
      wait_s = std::min(wait_s, wait);
    }
    emit_spot(spot, state_.time_s + std::clamp(wait_s, -kTogether, kTogether), before);
  }
}

void Island::emit_spot(const std::vector<const ImpactPoint*>& points, double touch_s, const Snapshot& before) {
  const ImpactPoint& first = *points.front();
  Point impulse(0), where(0), normal(0);
  double push = 0.0, approach = 0.0;
  for (const ImpactPoint* p : points) {
    const double share = dot(p->impulse, p->normal);
    impulse += p->impulse;
    where += share * p->where;
    normal += share * p->normal;
    approach = std::max(approach, p->approach_m_s);
    push += share;
  }
  where /= push;
  normal /= normal.norm();
  const double inverse_mass = calc_inverse_effective_mass(before.mobiles, first.a, first.b, where, normal);
  if (push * inverse_mass < 0.2 * kSlowest) return;  // a resting spot that the impact elsewhere hardly moved
  // Where several spots share an impact, each carries its part of the mass.
  const double e = first.restitution;
  const double speed = approach > kSlowest ? approach : push * inverse_mass;
  const double mass = std::min(push / ((1.0 + e) * speed), 1.0 / inverse_mass);
  lasting_.note_impact(engine_, first.a, first.b, where, state_.time_s);
  Impulse pulse;
  pulse.duration_s = calc_duration(first.a, first.b, before, where, normal, mass, speed);
  pulse.time_s = touch_s + 0.5 * pulse.duration_s;
  for (const int side : {0, 1}) {
    const int body = side == 0 ? first.a : first.b;
    if (body < 0) continue;
    const Transform& pose = before.poses[body];
    const Point on_body = ~pose.R() * (side == 0 ? impulse : Point(-impulse));
    bool inside = false;
    int face = 0;
    SimTK::Vec2 uv;
    engine_.surface(body).mesh().find_nearest(~pose * where, inside, face, uv);
    pulse.body = find_member(body);
    pulse.other = find_member(side == 0 ? first.b : first.a);
    pulse.triangle = engine_.surface(body).bank_triangle(face);
    pulse.barycentric = {uv[0], uv[1], 1.0 - uv[0] - uv[1]};
    pulse.impulse_n_s = {on_body[0], on_body[1], on_body[2]};
    events_.push_back(pulse);
  }
}

void Island::record() {
  for (std::size_t i = 0; i < members_.size(); ++i) {
    if (engine_.is_fixed(static_cast<int>(i))) continue;
    const SimTK::Quaternion q = state_.poses[i].R().convertRotationToQuaternion();
    const Point &x = state_.mobiles[i].centre, &v = state_.mobiles[i].velocity;
    events_.push_back(stream::Motion{state_.time_s, members_[i], {x[0], x[1], x[2]}, {v[0], v[1], v[2]}, {q[0], q[1], q[2], q[3]}});
  }
}

void Island::follow_contacts() {
  std::vector<stream::Contact> contacts;
  lasting_.update(engine_, members_, state_, contacts);
  for (stream::Contact& c : contacts) {
    c.body = find_member(c.body);
    c.other = find_member(c.other);
    events_.push_back(c);
  }
}

void Island::add_spots(std::vector<Spot>& out) const {
  for (Spot spot : lasting_.spots()) {
    spot.a = find_member(spot.a);
    spot.b = find_member(spot.b);
    for (stream::Contact& c : spot.last) {
      c.body = find_member(c.body);
      c.other = find_member(c.other);
    }
    out.push_back(std::move(spot));
  }
}

void Island::note_moves() {
  for (std::size_t i = 0; i < members_.size(); ++i) {
    const Surface& surface = engine_.surface(static_cast<int>(i));
    const Transform &from = begin_poses_[i], &to = state_.poses[i];
    const double turned = (from.R().asMat33() - to.R().asMat33()).norm();
    moved_m_[i] = std::max(moved_m_[i], (from * surface.middle_m() - to * surface.middle_m()).norm() + turned * surface.radius_m());
  }
}

void Island::begin_window() {
  begin_poses_ = state_.poses;
  moved_m_.assign(members_.size(), 0.0);
  events_.clear();
  taken_j_ = least_taken_j_ = 0.0;
}

/// Does everything lie and stay? (In the air nothing does, at the top of its flight either.)
bool Island::is_still(bool in_touch) const {
  if (!in_touch) return false;
  for (std::size_t i = 0; i < members_.size(); ++i) {
    const Mobile& m = state_.mobiles[i];
    if (m.velocity.norm() + m.spin.norm() * engine_.surface(static_cast<int>(i)).size_m() > kStill) return false;
  }
  return true;
}

bool Island::is_asleep() const { return state_.time_s - still_since_s_ > kAsleepAfter; }

bool Island::step(double until_s) {
  if (until_s - state_.time_s <= kTouchTime) return true;
  note_moves();
  if (is_asleep()) {
    state_.time_s = until_s;
    record();
    return true;
  }
  auto touches = engine_.find_touches(state_.poses);
  engine_.add_held(touches, state_);
  old_ = find_old(state_, touches);
  remember(state_, touches);
  engine_.set_resting(touches, state_);
  const double step = std::min(until_s - state_.time_s, engine_.calc_largest_step(state_, !touches.empty()));
  bool impact = false;
  if (stuck_ > 30) {
    // Impacts that leave each other no time (a body wedged in): let the soft force have it for a moment.
    state_ = engine_.calc_advanced(state_, std::min(step, kTogether));
    stuck_ = 0;
  } else {
    const Step next = calc_step(step);
    impact = next.impact;
    stuck_ = impact && next.state.time_s - state_.time_s < 1e-6 ? stuck_ + 1 : 0;
    state_ = next.state;
    if (impact) {
      const double before = audits_ ? engine_.calc_kinetic_j(state_) : 0.0;
      strike();
      const double taken = audits_ ? before - engine_.calc_kinetic_j(state_) : 0.0;
      taken_j_ += taken;
      least_taken_j_ = std::min(least_taken_j_, taken);
    }
  }
  const bool done = until_s - state_.time_s <= kTouchTime;
  if (impact || !is_still(!touches.empty())) still_since_s_ = state_.time_s;
  if (has_lasting_) follow_contacts();
  if (impact || done) {
    note_moves();
    record();
  }
  return done;
}

void Island::store(WorldModel& scene) const {
  for (std::size_t i = 0; i < members_.size(); ++i) {
    if (engine_.is_fixed(static_cast<int>(i))) continue;
    BodyModel& body = scene.bodies[members_[i]];
    const SimTK::Quaternion q = state_.poses[i].R().convertRotationToQuaternion();
    const Point &p = state_.poses[i].p(), &v = state_.mobiles[i].velocity, &w = state_.mobiles[i].spin;
    body.initial = {state_.time_s, {p[0], p[1], p[2]}, {q[0], q[1], q[2], q[3]}};
    body.velocity_m_s = {v[0], v[1], v[2]};
    body.angular_velocity_rad_s = {w[0], w[1], w[2]};
  }
}

void Island::add_recent(std::vector<OldPoint>& out) const {
  for (const OldPoint& o : recent_) out.push_back({find_member(o.a), find_member(o.b), o.in_a, o.time_s});
}

void Island::add_rested(std::vector<RestedPoint>& out) const {
  for (RestedPoint r : engine_.get_rested()) {
    r.a = find_member(r.a);
    r.b = find_member(r.b);
    out.push_back(r);
  }
}

}  // namespace carillon::contact
