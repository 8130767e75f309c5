// Method: predicted motion of a step without contacts, and persistent touches as points of its velocity problem; impulses act at mid-step.
// With arms from x0 + h v0 / 2 the momentum and angular momentum of a free island are conserved to rounding, and a contact that neither
// slides nor strikes does no work.
// Source: J. J. Moreau, "Unilateral contact and dry friction in finite freedom dynamics" (1988), the step with the impulse at its middle.
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <numeric>

#include "runtime/physics/rigid/cords.hpp"
#include "runtime/physics/rigid/grab.hpp"
#include "runtime/physics/rigid/instants.hpp"
#include "runtime/physics/rigid/limits.hpp"
#include "runtime/physics/rigid/step_problem.hpp"

namespace carillon::rigid {
namespace {

constexpr double kTwistArmRatio = 3.0 * std::numbers::pi / 16.0;  // twisting arm over friction times patch radius
constexpr double kRestSpeedMS = 1e-6;                             // m/s
constexpr double kRestTurnRad = 1e-7;                             // rad in a step
constexpr double kMaxRollingRatio = 20.0;                         // relative to the size: maximum travel of a touch per rolling angle
constexpr int kPairBlock = 16;                                    // block length for interleaving points by pair

/// Sorts points by height, so that one sweep propagates the weight down a pile. Within each block of kPairBlock points the first points of
/// all pairs come first, then the second ones, and so on: this order needs 10 % fewer sweeps.
void sort_points(Step& step, const Vec3& gravity) {
  const int count = static_cast<int>(step.points.size());
  if (count < 2) return;
  std::vector<double> heights;
  heights.reserve(count);
  for (const ContactRef& row : step.rows) heights.push_back(-dot(row.get().touch.where_m, gravity));
  std::vector<int> order(count);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](int x, int y) { return heights[x] < heights[y]; });
  std::array<const Pair*, kPairBlock> pairs;
  std::array<int, kPairBlock> sorted, turns;  // turns: index of each point within its pair
  for (int begin = 0; begin < count; begin += kPairBlock) {
    const int size = std::min(kPairBlock, count - begin);
    int last = 0;
    for (int n = 0; n < size; ++n) {
      sorted[n] = order[begin + n];
      pairs[n] = step.rows[sorted[n]].pair;
      turns[n] = static_cast<int>(std::count(pairs.begin(), pairs.begin() + n, pairs[n]));
      last = std::max(last, turns[n]);
    }
    int at = begin;
    for (int turn = 0; turn <= last; ++turn)
      for (int n = 0; n < size; ++n)
        if (turns[n] == turn) order[at++] = sorted[n];
  }
  std::vector<Point> points;
  std::vector<ContactRef> rows;
  points.reserve(count);
  rows.reserve(count);
  for (const int n : order) points.push_back(step.points[n]), rows.push_back(step.rows[n]);
  step.points.swap(points);
  step.rows.swap(rows);
}

/// Path of a touch relative to one of its bodies during a step.
struct ArmPath {
  Vec3 middle{}, first{}, last{};  // centre at mid-step; arms at both ends
  Vec3 centre{};                   // origin of the arm of the impulse
  bool has_joints = false;
};

/// `later`: the touch at the end of the step; n: index of the body in the step.
ArmPath make_arm_path(const Bodies& bodies, const Step& step, const geometry::Touch& t, bool moves, const Vec3& later, int body, int n) {
  const State& state = bodies.state(body);
  const FreeMotion& free = step.free[n];
  ArmPath path;
  path.middle = state.centre + (0.5 * step.length_s) * state.velocity;
  path.centre = path.middle;
  path.has_joints = free.articulation >= 0;
  if (path.has_joints) {
    path.middle = 0.5 * (state.centre + free.state.centre);
    path.centre = free.state.centre;
  }
  path.first = t.where_m - state.centre;
  path.last = moves ? later - free.state.centre : free.placed.rotation * (transpose(bodies.placed(body).rotation) * path.first);
  return path;
}

}  // namespace

void StepProblem::predict(Step& step, double length_s, bool at_rest) {
  step.length_s = length_s;
  step.movers.resize(step.count());
  step.free.resize(step.count());
  step.articulations.clear();
  bodies_.for_articulations(step.island().bodies, [&](Articulation& a) { step.articulations.push_back({&a, {}, {}, {}}); });
  for (int k = 0; k < static_cast<int>(step.articulations.size()); ++k) predict_articulation(step, k, at_rest);
  for (int n = 0; n < step.count(); ++n) {
    const int i = step.body(n);
    if (bodies_.find_articulation(i) != nullptr) continue;
    State from = bodies_.state(i);
    if (at_rest) from.velocity = from.momentum = {};
    FreeMotion& to = step.free[n];
    to.state = fly(bodies_.solid(i), from, bodies_.gravity(), length_s);
    to.placed = place(bodies_.solid(i), to.state);
    to.articulation = -1;
    step.movers[n] = {1.0 / bodies_.solid(i).mass_kg, to.placed.inverse_inertia, to.state.velocity, to.placed.spin};
  }
  add_loads(step);
  add_pulls(step);
}

void StepProblem::predict_articulation(Step& step, int number, bool at_rest) {
  ArticulationStep& a = step.articulations[number];
  joints::Mechanism& mechanism = *a.articulation->mechanism;
  joints::Coordinates from = a.articulation->now;
  if (at_rest) std::fill(from.u.begin(), from.u.end(), 0.0);
  a.free = bodies_.fly(*a.articulation, from, step.length_s);
  ++ledger_.costs.flights;
  a.linkage.set(mechanism, a.free);
  std::vector<joints::Motion> motions;
  mechanism.find_motions(a.free, motions);
  for (int k = 0; const int i : a.articulation->bodies) {
    const int n = step.find(i);
    a.linkage.movers.push_back(n);
    FreeMotion& to = step.free[n];
    to.state = bodies_.make_member_state(i, motions[k]);
    to.placed = place(bodies_.solid(i), to.state);
    to.placed.spin = motions[k].spin;
    to.articulation = number;
    step.movers[n] = {1.0 / bodies_.solid(i).mass_kg, to.placed.inverse_inertia, to.state.velocity, to.placed.spin, &a.linkage, k++};
  }
}

/// Sleeping bodies keep acting on an island with the forces that they had when they fell asleep.
void StepProblem::add_loads(Step& step) const {
  step.loads.assign(step.count(), {});
  for (const Pair* pair : step.island().pairs) {
    if (bodies_.moves(pair->a) == bodies_.moves(pair->b)) continue;
    const bool is_a = bodies_.moves(pair->a);
    const int n = step.find(is_a ? pair->a : pair->b);
    for (const Contact& c : pair->contacts)
      if (n >= 0 && step.movers[n].linkage == nullptr && c.is_load) add_pull(bodies_, c, is_a, step.length_s * c.rest_n, step.loads[n]);
  }
  for (int n = 0; n < step.count(); ++n) {
    Mover& mover = step.movers[n];
    mover.velocity = mover.velocity + mover.inverse_mass * step.loads[n].linear;
    mover.spin = mover.spin + mover.inverse_inertia * step.loads[n].angular;
  }
}

/// Grabs of free bodies act all along the step. Bodies on joints get their impulse at its start (Space::pull_joints()).
void StepProblem::add_pulls(Step& step) const {
  step.pulls.clear();
  for (const Grab& grab : bodies_.grabs()) {
    const int n = step.find(grab.body);
    if (n < 0 || step.movers[n].linkage != nullptr) continue;
    step.pulls.resize(step.count());
    step.pulls[n] = calc_grab_impulse(bodies_, grab, step.length_s);
    Mover& mover = step.movers[n];
    mover.velocity = mover.velocity + mover.inverse_mass * step.pulls[n].linear;
    mover.spin = mover.spin + mover.inverse_inertia * step.pulls[n].angular;
  }
}

/// Radius of the Hertz contact under the load of the last step [m]; 0 without load.
double StepProblem::calc_patch_radius(const Contact& c) const {
  const double push = c.step_s > 0.0 ? dot(c.impulse, c.touch.normal) / c.step_s : 0.0;
  if (!(push > 0.0)) return 0.0;
  return impact::calc_patch_radius(push, bodies_.calc_contact_radius(c.touch, c.a, c.b), bodies_.calc_compliance(c.a, c.b));
}

/// Travel of a touch over the more curved surface per rolling angle [m]; at rest the radius of the largest curvature. A polygonal rim moves
/// from corner to corner, as far as a round one.
double StepProblem::calc_rolling_radius(const Step& step, const Point& p, const Contact& c, const geometry::Touch& moved) const {
  const geometry::Touch& t = c.touch;
  const double at_rest = std::max(t.rim_m, 1.0 / std::max(t.curvature_a_per_m + t.curvature_b_per_m, t.steepest_per_m));
  const Vec3 spin = (p.a >= 0 ? step.free[p.a].placed.spin : Vec3{}) - (p.b >= 0 ? step.free[p.b].placed.spin : Vec3{});
  const double turned = step.length_s * norm(spin - dot(spin, t.normal) * t.normal);
  if (turned < kRestTurnRad) return at_rest;
  return std::clamp(geometry::calc_travel(t, moved) / turned, at_rest, std::max(at_rest, kMaxRollingRatio * bodies_.calc_size(c.a, c.b)));
}

/// Row of a persistent touch in the step.
Point StepProblem::make_lasting_point(const Step& step, Pair& pair, const Contact& c) const {
  const geometry::Touch& t = c.touch;
  const double h = step.length_s, approach = bodies_.calc_approach(t, c.a, c.b);
  Point p = make_point(bodies_, step, c);
  // The touch of a curved surface moves over it: its position at the end of the step without contacts.
  const auto get_frame = [&](int body) {
    const int n = step.find(body);
    return n >= 0 ? step.free[n].placed.frame : bodies_.get_frame(body);
  };
  geometry::Touch moved = t.smooth ? touches_.find_moved(pair, t, get_frame(pair.a), get_frame(pair.b)) : t;
  const bool moves = t.smooth && !touches_.is_far_jump(pair, t, moved);  // false for a separate touch, e.g. the other end of a rod
  if (!moves) moved = t;
  const Vec3& later = moved.where_m;
  // The impulse acts at mid-step, at the same point for both bodies.
  Vec3 where{};
  ArmPath sa, sb;
  if (p.a >= 0) sa = make_arm_path(bodies_, step, t, moves, later, c.a, p.a), where = sa.middle + 0.5 * (sa.first + sa.last);
  if (p.b >= 0) {
    sb = make_arm_path(bodies_, step, t, moves, later, c.b, p.b);
    const Vec3 other = sb.middle + 0.5 * (sb.first + sb.last);
    where = p.a >= 0 ? 0.5 * (where + other) : other;
  }
  // The rotation of the arms after mid-step contributes to the velocity at the point.
  Vec3 beyond{};
  if (p.a >= 0) {
    p.arm_a = where - sa.centre;
    beyond = beyond + cross(step.free[p.a].placed.spin, sa.has_joints ? sa.last - p.arm_a : 0.5 * (sa.last - sa.first));
  }
  if (p.b >= 0) {
    p.arm_b = where - sb.centre;
    beyond = beyond - cross(step.free[p.b].placed.spin, sb.has_joints ? sb.last - p.arm_b : 0.5 * (sb.last - sb.first));
  }
  // The normal at mid-step: that of a plane rotates with its body; otherwise a sliding touch would leave the plane or sink in.
  double turning = 0.0;  // resulting closing speed
  if (!t.smooth && c.touching) {
    const int owner = t.side_b == geometry::Side::plane ? c.b : t.side_a == geometry::Side::plane ? c.a : -1;
    if (bodies_.moves(owner)) {
      p.normal = carillon::normalise(t.normal + (0.5 * h) * cross(bodies_.placed(owner).spin, t.normal));
      turning = -dot(bodies_.calc_velocity(c.a, t.where_m) - bodies_.calc_velocity(c.b, t.where_m), p.normal) - approach;
    }
  }
  // A resting touch keeps its gap exactly: a gap of a picometre would cause a force.
  const bool rests = t.gap_m <= kTouchGapM && c.touching && std::abs(approach) < kRestSpeedMS;
  // A deep touch that separates may return to its present depth: stopping its separation by a push would do work.
  const double free_way = t.gap_m < -kDeepM ? 0.0 : t.gap_m;
  double speed = rests ? 0.0 : std::min(0.0, approach - 2.0 * free_way / h);
  // Penetration is removed at half the power that the contact loses, so that no energy is gained.
  if (t.gap_m < -kDeepM) {
    const double push = dot(c.impulse, t.normal), paid = push > 0.0 ? 0.5 * c.lost_j / push : 0.0;
    const double up = std::min(kPushOutRatePerS * (-kDeepM - t.gap_m), paid);
    if (approach > -up) speed = up;
  }
  p.wanted = (speed + turning) * p.normal - beyond;
  const double curvature = t.curvature_a_per_m + t.curvature_b_per_m;
  if (t.smooth && (curvature > 0.0 || t.steepest_per_m * bodies_.calc_size(c.a, c.b) > 1.0)) {
    const double settling = bodies_.calc_settling(c.a, c.b);
    p.rolling_m = settling * bodies_.calc_rolling_resistance(c.a, c.b) * calc_rolling_radius(step, p, c, moved);
    p.twisting_m = settling * kTwistArmRatio * p.friction * calc_patch_radius(c);
  }
  p.impulse = (c.step_s > 0.0 ? h / c.step_s : 0.0) * c.impulse;
  if (c.is_load) p.impulse = p.impulse - h * c.rest_n;
  p.couple = (c.step_s > 0.0 ? h / c.step_s : 0.0) * c.couple;
  return p;
}

void StepProblem::make_points(Step& step, bool leaves_impacts) const {
  step.points.clear();
  step.rows.clear();
  const double h = step.length_s;
  for (Pair* pair : step.island().pairs) {
    if (!step.has(*pair)) continue;
    for (int k = 0; const Contact& c : pair->contacts) {
      const ContactRef row{pair, k++};
      const double approach = bodies_.calc_approach(c.touch, c.a, c.b);
      if (c.presses || (leaves_impacts && (is_fast(bodies_, *pair, c, h) || c.closes_s >= 0.0))) continue;
      // The impact moves these bodies; ringing static ones still support others.
      if (c.cord < 0 && (bodies_.is_moved_by_impact(pair->a) || bodies_.is_moved_by_impact(pair->b))) continue;
      if (c.touch.gap_m > kTouchGapM + 2.0 * h * std::max(approach, 0.0) + 4.0 * norm(bodies_.gravity()) * h * h && !c.touching) continue;
      step.points.push_back(c.cord >= 0 ? make_cord_point(bodies_, step, touches_.cord(c.cord), c) : make_lasting_point(step, *pair, c));
      step.rows.push_back(row);
    }
  }
  sort_points(step, bodies_.gravity());
}

}  // namespace carillon::rigid
