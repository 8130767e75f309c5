// Method: event-driven. Between impacts Simbody integrates the motion; after each step the surfaces are tested, and a new touch that
// approaches
//   faster than kSlowest is traced back to its first instant, where all touching points are solved together for their impulses and the
//   velocities jump. Slower touches, and points beside a spot that already rests, are left to a soft force and make no sound. The real
//   contact lasts a Hertz time from the touch on, so its pulse is centred half that time later.
// Source: B. Mirtich, "Impulse-based dynamic simulation of rigid body systems" (1996); J. O'Brien, C. Shen, C. Gatchalian, "Synthesizing
// sounds from
//   rigid-body simulations" (2002), section 4, for what the sound needs of it.
// Deviations: resting contact is a damped spring, not a train of micro-impacts, since those would be heard.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <ctime>
#include <map>
#include <optional>
#include <tuple>

#include "runtime/config/error.hpp"
#include "runtime/contact/engine.hpp"

namespace carillon::contact {
namespace {

using SimTK::dot;
using SimTK::State;
using SimTK::Transform;
using Point = SimTK::Vec3;

constexpr double kSlowest = 0.01;     // m/s; a touch slower than this is not an impact (a fall from 5 um)
constexpr double kTogether = 1e-4;    // s; touches nearer in time than this are one impact (a Hertz contact lasts about as long)
constexpr double kTouchDepth = 3e-7;  // m; how well the first instant of a touch is found
constexpr double kTouchTime = 2e-7;   // s; the same in time
constexpr double kRollingTime =
    10e-3;  // s; a body that rolls or slides over the corners of its own mesh hops from one to the next so fast ...
constexpr double kRollingSpeed = 0.1;  // m/s; ... and lands on them slower than this: that is the mesh, not the body, and must not be heard
constexpr double kSamePlace = 2e-4;    // m; a bouncing body comes back to the same place, a rolling one does not
constexpr double kPoseInterval = 2e-3;  // s

/// A point that was in contact a moment ago.
struct OldPoint {
  int a, b;
  Point in_a;
  double time_s;
};

struct Step {
  State state;
  bool impact = false;
};

class Simulator {
 public:
  Simulator(const WorldModel& world, double duration_s) : engine_(world), duration_s_(duration_s), state_(engine_.initial_state()) {}

  Simulation run(const std::function<void(double)>& progress);

 private:
  void record_poses(bool fixed_as_well);
  std::vector<OldPoint> find_old(const Snapshot& now, const std::vector<TouchPoint>& touches) const;
  bool is_old(const TouchPoint& touch, const Snapshot& now, double approach) const;
  void remember(const Snapshot& now, const std::vector<TouchPoint>& touches);
  std::vector<TouchPoint> find_fresh(const Snapshot& now, double faster_than) const;
  Step calc_step(double step_s);
  void strike();
  void emit(const std::vector<ImpactPoint>& points, const std::vector<TouchPoint>& touches, const Snapshot& before);
  void emit_spot(const std::vector<const ImpactPoint*>& points, double touch_s, const Snapshot& before);

  Engine engine_;
  double duration_s_;
  State state_;
  std::vector<OldPoint> old_;     // in contact when the step began and not about to leave
  std::vector<OldPoint> recent_;  // in contact within the last kRollingTime
  Simulation result_;
  int stuck_ = 0;  // impacts in a row with no time between them
};

double calc_approach(const Engine& engine, const Snapshot& now, const TouchPoint& touch) {
  return -dot(calc_relative_velocity(now.mobiles, engine.make_impact_point(touch)), touch.normal);
}

std::vector<OldPoint> Simulator::find_old(const Snapshot& now, const std::vector<TouchPoint>& touches) const {
  std::vector<OldPoint> old;
  for (const TouchPoint& t : touches) {
    if (calc_approach(engine_, now, t) > -0.5 * kSlowest) old.push_back({t.a, t.b, ~now.poses[t.a] * t.where, state_.getTime()});
  }
  return old;
}

/// Does the touch belong to a spot that is in contact anyway, or to a body that rolls?
bool Simulator::is_old(const TouchPoint& t, const Snapshot& now, double approach) const {
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

void Simulator::remember(const Snapshot& now, const std::vector<TouchPoint>& touches) {
  const double time = state_.getTime();
  const auto stale = [&](const OldPoint& o) { return o.time_s < time - kRollingTime; };
  recent_.erase(std::remove_if(recent_.begin(), recent_.end(), stale), recent_.end());
  for (const TouchPoint& t : touches) recent_.push_back({t.a, t.b, ~now.poses[t.a] * t.where, time});
}

/// Touches that were not there when the step began and approach faster than that.
std::vector<TouchPoint> Simulator::find_fresh(const Snapshot& now, double faster_than) const {
  std::vector<TouchPoint> fresh;
  for (const TouchPoint& t : engine_.find_touches(now.poses)) {
    const double approach = calc_approach(engine_, now, t);
    if (approach > faster_than && !is_old(t, now, approach)) fresh.push_back(t);
  }
  return fresh;
}

/// One step, or less when a fresh touch comes in between: then up to its first instant. It is an impact if it is fast even there (a body
/// set down with no gap gains speed within the step).
Step Simulator::calc_step(double step_s) {
  double low = 0.0, high = SimTK::Infinity, step = step_s, creep = 2e-6;
  Step touch;
  for (int attempt = 0; attempt < 80 && high - low > kTouchTime; ++attempt) {
    const State state = engine_.calc_advanced(state_, step);
    ++result_.steps;
    const Snapshot now = engine_.calc_snapshot(state);
    const auto fresh = find_fresh(now, attempt == 0 ? kSlowest : 0.0);
    if (fresh.empty() && attempt == 0) return {state, false};
    if (fresh.empty()) {
      low = step;
      step = std::min(low + creep, 0.5 * (low + high));
      creep *= 8;
      continue;
    }
    double deepest = 0.0, earlier = 0.0, fastest = 0.0;
    for (const TouchPoint& t : fresh) {
      const double approach = calc_approach(engine_, now, t);
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

/// Solves the impact at the present instant and notes its pulses.
void Simulator::strike() {
  const Snapshot now = engine_.calc_snapshot(state_);
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
    if (is_old(touch, now, calc_approach(engine_, now, touch))) points.back().restitution = 0.0;
  }
  remember(now, touches);
  Snapshot after = now;
  solve_impact(after.mobiles, points, kSlowest);
  engine_.set_velocities(state_, after.mobiles);
  emit(points, touches, now);
}

/// Gathers the points into spots, strongest first, and notes one pulse a spot and body.
void Simulator::emit(const std::vector<ImpactPoint>& points, const std::vector<TouchPoint>& touches, const Snapshot& before) {
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
    emit_spot(spot, state_.getTime() + std::clamp(wait_s, -kTogether, kTogether), before);
  }
}

void Simulator::emit_spot(const std::vector<const ImpactPoint*>& points, double touch_s, const Snapshot& before) {
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
  double largest_radius = 0.5 * engine_.surface(first.a).size_m();
  if (first.b >= 0) largest_radius = std::min(largest_radius, 0.5 * engine_.surface(first.b).size_m());
  const Elastic elastic_a = engine_.make_elastic(first.a, before.poses[first.a], where, -normal);
  const Elastic elastic_b = engine_.make_elastic(first.b, first.b >= 0 ? before.poses[first.b] : Transform(), where, normal);
  Impulse pulse;
  pulse.duration_s = calc_hertz_duration(elastic_a, elastic_b, mass, speed, largest_radius);
  pulse.time_s = touch_s + 0.5 * pulse.duration_s;
  for (const int side : {0, 1}) {
    const int body = side == 0 ? first.a : first.b;
    if (body < 0) continue;
    const Transform& pose = before.poses[body];
    const Point on_body = ~pose.R() * (side == 0 ? impulse : Point(-impulse));
    bool inside = false;
    int face = 0;
    SimTK::Vec2 uv;
    engine_.surface(body).mesh().findNearestPoint(~pose * where, inside, face, uv);
    pulse.body = body;
    pulse.other = side == 0 ? first.b : first.a;
    pulse.triangle = engine_.surface(body).bank_triangle(face);
    pulse.barycentric = {uv[0], uv[1], 1.0 - uv[0] - uv[1]};
    pulse.impulse_n_s = {on_body[0], on_body[1], on_body[2]};
    result_.impulses.push_back(pulse);
  }
}

void Simulator::record_poses(bool fixed_as_well) {
  const double now_s = state_.getTime();
  const Snapshot now = engine_.calc_snapshot(state_);
  for (std::size_t i = 0; i < now.poses.size(); ++i) {
    auto& path = result_.poses[i];
    if (engine_.is_fixed(static_cast<int>(i)) && !fixed_as_well) continue;
    if (!path.empty() && path.back().time_s == now_s) continue;
    const auto q = now.poses[i].R().convertRotationToQuaternion();
    const Point& p = now.poses[i].p();
    path.push_back({now_s, {p[0], p[1], p[2]}, {q[0], q[1], q[2], q[3]}});
  }
}

Simulation Simulator::run(const std::function<void(double)>& progress) {
  const std::clock_t begin = std::clock();
  result_.poses.resize(engine_.world().bodies.size());
  record_poses(true);
  double reported = 0.0;
  std::int64_t next_pose = 1;
  while (duration_s_ - state_.getTime() > kTouchTime) {
    const Snapshot now = engine_.calc_snapshot(state_);
    const auto touches = engine_.find_touches(now.poses);
    old_ = find_old(now, touches);
    remember(now, touches);
    engine_.set_resting(touches);
    // To the next pose at most, which are on a grid.
    while (static_cast<double>(next_pose) * kPoseInterval <= state_.getTime() + kTouchTime) ++next_pose;
    const double until = std::min(duration_s_, static_cast<double>(next_pose) * kPoseInterval);
    const double step = std::min(until - state_.getTime(), engine_.calc_largest_step(now, !touches.empty()));
    bool impact = false;
    if (stuck_ > 30) {
      // Impacts that leave each other no time (a body wedged in): let the soft force have it for a moment.
      state_ = engine_.calc_advanced(state_, std::min(step, kTogether));
      stuck_ = 0;
    } else {
      const Step next = calc_step(step);
      impact = next.impact;
      stuck_ = impact && next.state.getTime() - state_.getTime() < 1e-6 ? stuck_ + 1 : 0;
      state_ = next.state;
      if (impact) strike();
    }
    if (impact || state_.getTime() > until - kTouchTime) record_poses(false);
    const double fraction = state_.getTime() / duration_s_;
    if (progress && fraction >= reported + 0.01) progress(reported = std::min(fraction, 1.0));
  }
  record_poses(true);
  const auto earlier = [](const Impulse& x, const Impulse& y) { return x.time_s < y.time_s; };
  std::stable_sort(result_.impulses.begin(), result_.impulses.end(), earlier);
  result_.seconds_cpu = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  if (progress) progress(1.0);
  return std::move(result_);
}

}  // namespace

Simulation run_simulation(const WorldModel& world, double duration_s, const std::function<void(double)>& progress) {
  try {
    Simulator simulator(world, duration_s);
    return simulator.run(progress);
  } catch (const SimTK::Exception::Base& e) {
    throw SolveError(fmt::format("Simbody gave up on the world of {}: {}", list_names(world), e.what()));
  }
}

}  // namespace carillon::contact
