// Method: a cord is a contact between its two anchors: the gap is the length until taut, the normal lies along the cord, and the cord only
// pulls. The normal of a step is that at mid-step: a taut cord then keeps its length and does no work while its body swings. A cord has no
// mass, and its tug on the surface of a body is inaudible. A stop of a joint is a contact of the same kind with a normal along the motion
// of the joint, also inaudible.
// Source: J. J. Moreau, "Unilateral contact and dry friction in finite freedom dynamics" (1988).
#include "runtime/physics/rigid/cords.hpp"

#include <algorithm>
#include <cmath>

#include "runtime/physics/rigid/limits.hpp"

namespace carillon::rigid {
namespace {

constexpr double kMaxStretchM = 5e-5;   // m; a cord stretched further is shortened even if that gains energy
constexpr double kMaxPushOutMS = 5e-3;  // m/s; maximum speed of that, and of a body pushed back to its stop

struct StopTouch {
  double gap_m = 0.0;
  Vec3 where_m{}, normal{};  // from b to a: direction of the push on a
};

struct Pose {
  Vec3 centre{};
  Mat3 rotation{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
};
Pose get_pose(const State& state) { return {state.centre, make_rotation(state.rotation)}; }

/// Position of a stop and its remaining travel for the given poses.
StopTouch calc_stop_touch(const Stop& stop, const Pose& a, const Pose& b) {
  const Vec3 axis = b.rotation * stop.axis, at_a = a.centre + a.rotation * stop.at_a;
  const double sign = stop.is_lower ? 1.0 : -1.0;
  if (!stop.turns) {
    const double way = dot(axis, at_a - (b.centre + b.rotation * stop.at_b));
    return {-sign * (stop.max - way), at_a, sign * axis};
  }
  const Vec3 lever_a = a.rotation * stop.lever_a, lever_b = b.rotation * stop.lever_b;
  const double angle = std::atan2(dot(axis, cross(lever_b, lever_a)), dot(lever_b, lever_a));
  return {-sign * stop.arm_m * (stop.max - angle), at_a + stop.arm_m * lever_a, sign * cross(axis, lever_a)};
}

/// World position of a cord end for a state of its body.
Vec3 calc_anchor(const Cord& cord, bool is_a, const State& state) {
  if (!is_a && cord.b < 0) return cord.at_b;
  return state.centre + make_rotation(state.rotation) * (is_a ? cord.at_a : cord.at_b);
}

/// Row of a stop in a step. Equal and opposite impulses at one point of two bodies connected by a joint move that joint alone.
Point make_stop_point(const Bodies& bodies, const Step& step, const Stop& stop, const Contact& c) {
  const double h = step.length_s;
  Point p;
  p.a = step.find(c.a);
  p.b = step.find(c.b);
  // Impulses act at the configuration of the mechanism at the end of the step without them (step.cpp).
  const auto get_end = [&](int body, int n) {
    if (n < 0) return body >= 0 ? get_pose(bodies.state(body)) : Pose{};
    return Pose{step.free[n].state.centre, step.free[n].placed.rotation};
  };
  const StopTouch end = calc_stop_touch(stop, get_end(c.a, p.a), get_end(c.b, p.b));
  p.normal = end.normal;
  if (p.a >= 0) p.arm_a = end.where_m - step.free[p.a].state.centre;
  if (p.b >= 0) p.arm_b = end.where_m - step.free[p.b].state.centre;
  const double approach = bodies.calc_approach(c.touch, c.a, c.b), gap = c.touch.gap_m;
  double speed = c.touching && gap <= kTouchGapM ? 0.0 : approach - 2.0 * std::max(gap, 0.0) / h;
  if (gap < -kDeepM) speed += std::min(kPushOutRatePerS * (-kDeepM - gap), kMaxPushOutMS);
  p.wanted = speed * p.normal;
  p.impulse = (c.step_s > 0.0 ? h / c.step_s : 0.0) * c.impulse;
  return p;
}

}  // namespace

double calc_cord_gap(const Cord& cord, const State& a, const State& b) {
  if (cord.stop) return calc_stop_touch(*cord.stop, get_pose(a), cord.b >= 0 ? get_pose(b) : Pose{}).gap_m;
  return cord.length_m - norm(calc_anchor(cord, true, a) - calc_anchor(cord, false, b));
}

void update_cord(const Bodies& bodies, const Cord& cord, Pair& pair) {
  const State& state_a = bodies.state(cord.a);
  const State state_b = cord.b >= 0 ? bodies.state(cord.b) : State{};
  StopTouch now;
  if (cord.stop) {
    now = calc_stop_touch(*cord.stop, get_pose(state_a), cord.b >= 0 ? get_pose(state_b) : Pose{});
  } else {
    now.where_m = calc_anchor(cord, true, state_a);
    const Vec3 way = calc_anchor(cord, false, state_b) - now.where_m;
    const double distance = norm(way);
    now.gap_m = cord.length_m - distance;
    if (distance > 0.0)
      now.normal = (1.0 / distance) * way;
    else if (!pair.contacts.empty())
      now.normal = pair.contacts.front().touch.normal;
  }
  if (pair.contacts.empty()) {
    Contact contact;
    contact.a = cord.a;
    contact.b = cord.b;
    contact.cord = pair.cord;
    contact.touching = now.gap_m <= kTouchGapM;
    pair.contacts.push_back(contact);
  }
  geometry::Touch& touch = pair.contacts.front().touch;
  touch.gap_m = now.gap_m;
  touch.where_m = now.where_m;
  touch.normal = now.normal;
}

/// Row of a cord in a step, along the cord at mid-step.
Point make_cord_point(const Bodies& bodies, const Step& step, const Cord& cord, const Contact& c) {
  if (cord.stop) return make_stop_point(bodies, step, *cord.stop, c);
  const double h = step.length_s;
  Point p;
  p.a = step.find(c.a);
  p.b = step.find(c.b);
  struct End {
    Vec3 middle{}, velocity{}, arm{},
        beyond{};  // world: at mid-step; now; from the centre to the impulse; rotation of the arm after mid-step
  };
  const auto make_end = [&](int body, int n, bool is_a) {
    End end;
    const Vec3& own = is_a ? cord.at_a : cord.at_b;
    if (n < 0) {
      end.middle = body < 0 ? own : calc_anchor(cord, is_a, bodies.state(body));
      return end;
    }
    const State& state = bodies.state(body);
    const FreeMotion& free = step.free[n];
    const bool has_joints = free.articulation >= 0;
    const Vec3 first = bodies.placed(body).rotation * own, last = free.placed.rotation * own;
    const Vec3 centre = has_joints ? 0.5 * (state.centre + free.state.centre) : state.centre + (0.5 * h) * state.velocity;
    end.middle = centre + 0.5 * (first + last);
    end.velocity = state.velocity + cross(bodies.placed(body).spin, first);
    end.arm = end.middle - (has_joints ? free.state.centre : centre);
    end.beyond = cross(free.placed.spin, last - end.arm);
    return end;
  };
  const End a = make_end(c.a, p.a, true), b = make_end(c.b, p.b, false);
  p.arm_a = a.arm;
  p.arm_b = b.arm;
  const Vec3 way = b.middle - a.middle;
  const double distance = norm(way);
  p.normal = distance > 0.0 ? (1.0 / distance) * way : c.touch.normal;
  const Vec3 u = a.velocity - b.velocity;
  const double along = dot(u, p.normal), error = dot(u, c.touch.normal), gap = c.touch.gap_m;
  // Taut: equal and opposite speeds along the mid-step direction at both ends of the step keep the length; present stretch remains.
  double speed = c.touching && gap <= kTouchGapM ? error - along : -along - 2.0 * std::max(gap, 0.0) / h;
  // Excess length is removed like penetration, at half the power that the cord loses (step_points.cpp).
  if (gap < -kDeepM) {
    const double pull = dot(c.impulse, c.touch.normal), paid = pull > 0.0 ? std::max(0.5 * c.lost_j / pull, 0.0) : 0.0;
    speed += std::min(kPushOutRatePerS * (-kDeepM - gap), gap < -kMaxStretchM ? kMaxPushOutMS : paid);
  }
  p.wanted = speed * p.normal - (a.beyond - b.beyond);
  p.impulse = (c.step_s > 0.0 ? h / c.step_s : 0.0) * c.impulse;
  return p;
}

}  // namespace carillon::rigid
