// Method: a cord is a contact between the two places it is tied to: the gap is what it lacks to be taut, the normal lies along it, it pulls
//   and never pushes. In a step the normal is that of the middle of the step: with it a taut cord keeps its length and does no work while
//   its body swings.
// Source: J. J. Moreau, "Unilateral contact and dry friction in finite freedom dynamics" (1988).
// Deviations: a cord has no mass, and what it does to its body's surface when it comes taut is not heard. A stop of a joint is such a
//   contact, too, with a normal along the way of its joint, and is not heard either.
#include <algorithm>
#include <cmath>

#include "runtime/rigid/limits.hpp"
#include "runtime/rigid/space.hpp"

namespace carillon::rigid {
namespace {

struct StopTouch {
  double gap_m = 0.0;
  Vec3 where_m{}, normal{};  // from b to a: a is pushed along it
};

struct Pose {
  Vec3 centre{};
  Mat3 rotation{{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}};
};
Pose get_pose(const State& state) { return {state.centre, make_rotation(state.rotation)}; }

/// Where a stop pushes and what is left of the way to it, the bodies being there.
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

}  // namespace

/// Where an end of a cord is in the world, its body being there.
Vec3 Space::calc_anchor(const Cord& cord, bool is_a, const State& state) const {
  if (!is_a && cord.b < 0) return cord.at_b;
  return state.centre + make_rotation(state.rotation) * (is_a ? cord.at_a : cord.at_b);
}

double Space::calc_cord_gap(const Cord& cord, const State& a, const State& b) const {
  if (cord.stop) return calc_stop_touch(*cord.stop, get_pose(a), cord.b >= 0 ? get_pose(b) : Pose{}).gap_m;
  return cord.length_m - norm(calc_anchor(cord, true, a) - calc_anchor(cord, false, b));
}

/// The contact of a cord as it is now.
void Space::stretch(Pair& pair) const {
  const Cord& cord = cords_[static_cast<std::size_t>(pair.cord)];
  const State nowhere;
  if (cord.stop) {
    const StopTouch now = calc_stop_touch(*cord.stop, get_pose(state(cord.a)), cord.b >= 0 ? get_pose(state(cord.b)) : Pose{});
    if (pair.contacts.empty()) {
      Contact contact;
      contact.a = cord.a;
      contact.b = cord.b;
      contact.cord = pair.cord;
      contact.touching = now.gap_m <= kTouch;
      pair.contacts.push_back(contact);
    }
    shape::Touch& touch = pair.contacts.front().touch;
    touch.gap_m = now.gap_m;
    touch.where_m = now.where_m;
    touch.normal = now.normal;
    return;
  }
  const Vec3 a = calc_anchor(cord, true, state(cord.a)), b = calc_anchor(cord, false, cord.b >= 0 ? state(cord.b) : nowhere);
  const double distance = norm(b - a);
  if (pair.contacts.empty()) {
    Contact contact;
    contact.a = cord.a;
    contact.b = cord.b;
    contact.cord = pair.cord;
    contact.touching = cord.length_m - distance <= kTouch;
    pair.contacts.push_back(contact);
  }
  shape::Touch& touch = pair.contacts.front().touch;
  touch.gap_m = cord.length_m - distance;
  touch.where_m = a;
  if (distance > 0.0) touch.normal = (1.0 / distance) * (b - a);
}

void Space::add_cord(Pair& pair) {
  if (pair.window == window_) return;
  pair.window = window_;
  stretch(pair);
  near_.push_back(&pair);
  near_is_sorted_ = false;
}

/// Cords that may be taut within the window; their bodies do not fly.
void Space::open_cords(std::vector<char>& active, double length_s) {
  for (Pair& pair : cord_pairs_) {
    if (!moves(pair.a) && !moves(pair.b)) continue;
    stretch(pair);
    double speed = 0.0;
    for (const int body : {pair.a, pair.b})
      if (body >= 0) speed += reach_m_s_[static_cast<std::size_t>(body)];
    if (pair.contacts.front().touch.gap_m > speed * length_s + 1e-4) {
      pair.contacts.front().touching = false;
      continue;
    }
    add_cord(pair);
    for (const int body : {pair.a, pair.b})
      if (body >= 0) active[static_cast<std::size_t>(body)] = 1;
  }
}

/// The row of a cord in a step: along the cord half a step on.
Point Space::make_cord_point(const Contact& c, double h) const {
  const Cord& cord = cords_[static_cast<std::size_t>(c.cord)];
  if (cord.stop) return make_stop_point(c, h);
  Point p;
  p.a = find_index(c.a);
  p.b = find_index(c.b);
  struct End {
    Vec3 middle{}, velocity{}, arm{}, beyond{};  // in the world half a step on; now; from the centre that the impulse has; of the arm after
  };
  const auto make_end = [&](int body, int index, bool is_a) {
    End end;
    const Vec3& own = is_a ? cord.at_a : cord.at_b;
    if (index < 0) {
      end.middle = body < 0 ? own : calc_anchor(cord, is_a, state(body));
      return end;
    }
    const auto i = static_cast<std::size_t>(body), n = static_cast<std::size_t>(index);
    const bool linked = movers_[n].linkage != nullptr;
    const Vec3 first = placed_[i].rotation * own, last = free_[n].rotation * own;
    const Vec3 centre = linked ? 0.5 * (states_[i].centre + free_centre_[n]) : states_[i].centre + (0.5 * h) * states_[i].velocity;
    end.middle = centre + 0.5 * (first + last);
    end.velocity = states_[i].velocity + cross(placed_[i].spin, first);
    end.arm = end.middle - (linked ? free_centre_[n] : centre);
    end.beyond = cross(free_spin_[n], last - end.arm);
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
  // Taut: as fast along the middle at the end as against it now, which keeps the length; what it stretches by now it does not keep.
  double speed = c.touching && gap <= kTouch ? error - along : -along - 2.0 * std::max(gap, 0.0) / h;
  // What is too long is taken in as what is too deep comes up, at half the power that the cord loses (step.cpp).
  if (gap < -kDeep) {
    const double pull = dot(c.impulse, c.touch.normal), paid = pull > 0.0 ? std::max(0.5 * c.lost_j / pull, 0.0) : 0.0;
    speed += std::min(0.02 * (-kDeep - gap) / h, gap < -kFarTooDeep ? 5e-3 : paid);
  }
  p.wanted = speed * p.normal - (a.beyond - b.beyond);
  p.impulse = (c.step_s > 0.0 ? h / c.step_s : 0.0) * c.impulse;
  return p;
}

/// The row of a stop in a step. Equal and opposite impulses at one place on two bodies that a joint connects move that joint alone.
Point Space::make_stop_point(const Contact& c, double h) const {
  const Stop& stop = *cords_[static_cast<std::size_t>(c.cord)].stop;
  Point p;
  p.a = find_index(c.a);
  p.b = find_index(c.b);
  // Impulses act where the mechanism is at the end of the step without them (linked.cpp).
  const auto get_end = [&](int body, int index) {
    if (index < 0) return body >= 0 ? get_pose(state(body)) : Pose{};
    return Pose{free_centre_[static_cast<std::size_t>(index)], free_[static_cast<std::size_t>(index)].rotation};
  };
  const StopTouch end = calc_stop_touch(stop, get_end(c.a, p.a), get_end(c.b, p.b));
  p.normal = end.normal;
  if (p.a >= 0) p.arm_a = end.where_m - free_centre_[static_cast<std::size_t>(p.a)];
  if (p.b >= 0) p.arm_b = end.where_m - free_centre_[static_cast<std::size_t>(p.b)];
  const double approach = calc_approach(c), gap = c.touch.gap_m;
  double speed = c.touching && gap <= kTouch ? 0.0 : approach - 2.0 * std::max(gap, 0.0) / h;
  if (gap < -kDeep) speed += std::min(0.02 * (-kDeep - gap) / h, 5e-3);
  p.wanted = speed * p.normal;
  p.impulse = (c.step_s > 0.0 ? h / c.step_s : 0.0) * c.impulse;
  return p;
}

}  // namespace carillon::rigid
