// Method: bodies on joints are moved in the coordinates of their mechanism. Free motion is the mechanism's; what the contacts of a step
//   give is a change of its velocities, which acts all along the step, as for free bodies; so joints stay closed to rounding, and a contact
//   that neither slides nor strikes does no work to the order of the step. Impulses act where the mechanism is at the end of the step
//   without contacts, at the place where they press half a step on.
// Source: J. J. Moreau, "Unilateral contact and dry friction in finite freedom dynamics" (1988), in generalised coordinates.
// Deviations: none.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "runtime/base/error.hpp"
#include "runtime/rigid/groups.hpp"
#include "runtime/rigid/limits.hpp"
#include "runtime/rigid/space.hpp"

namespace carillon::rigid {
namespace {

constexpr double kRight = 0.01;  // of the kinetic energy: the most that a step of an impact is corrected by

}  // namespace

/// Makes the mechanisms: one a group of bodies that joints hold together. What is fixed is the world.
void Space::link(const Links& links) {
  if (links.joints.empty()) return;
  const int count = static_cast<int>(solids_.size());
  linked_of_.assign(solids_.size(), -1);
  member_.assign(solids_.size(), -1);
  Groups groups(count);
  std::vector<char> is_joined(solids_.size(), 0);
  for (const joints::Joint& joint : links.joints) {
    if (joint.body >= 0 && joint.to >= 0) joined_.insert(std::minmax(joint.body, joint.to));
    for (const int body : {joint.body, joint.to})
      if (!is_fixed(body)) is_joined[static_cast<std::size_t>(body)] = 1;
    if (!is_fixed(joint.body) && !is_fixed(joint.to)) groups.join(joint.body, joint.to);
  }
  for (int i = 0; i < count; ++i) {
    if (!is_joined[static_cast<std::size_t>(i)]) continue;
    int& of = linked_of_[static_cast<std::size_t>(groups.find(i))];
    if (of < 0) {
      of = static_cast<int>(linked_.size());
      linked_.emplace_back();
    }
    linked_of_[static_cast<std::size_t>(i)] = of;
    std::vector<int>& bodies = linked_[static_cast<std::size_t>(of)].bodies;
    member_[static_cast<std::size_t>(i)] = static_cast<int>(bodies.size());
    bodies.push_back(i);
  }
  for (Linked& linked : linked_) {
    std::vector<joints::Member> members;
    for (const int body : linked.bodies) {
      const auto i = static_cast<std::size_t>(body);
      members.push_back(
          {solids_[i].mass_kg, solids_[i].inertia_kg_m2, {states_[i].centre, states_[i].velocity, states_[i].rotation, placed_[i].spin}});
    }
    std::vector<joints::Joint> own;
    for (joints::Joint joint : links.joints) {
      if (find_linked(is_fixed(joint.body) ? joint.to : joint.body) != &linked) continue;
      joint.body = is_fixed(joint.body) ? -1 : get_member(joint.body);
      joint.to = is_fixed(joint.to) ? -1 : get_member(joint.to);
      linked.hangs = linked.hangs || joint.body < 0 || joint.to < 0;
      own.push_back(joint);
    }
    linked.mechanism = joints::make_mechanism(members, own, gravity_);
    linked.now = linked.mechanism->get_start();
    place_linked(linked);
  }
}

double Space::get_start_error(int body) const {
  const Linked* linked = find_linked(body);
  return linked != nullptr ? linked->mechanism->get_start_error() : 0.0;
}

joints::Coordinates Space::fly_linked(const Linked& linked, const joints::Coordinates& from, double time_s) const {
  try {
    return linked.mechanism->fly(from, time_s, options_.joint_tolerance);
  } catch (const std::runtime_error& error) {
    throw SolveError(fmt::format("bodies on joints, among them body {}, after {:.6f} s: {}", linked.bodies.front(), time_s_, error.what()));
  }
}

State Space::make_state(const Solid& solid, const joints::Motion& motion) {
  State state;
  state.centre = motion.centre;
  state.velocity = motion.velocity;
  state.rotation = motion.rotation;
  const Mat3 rotation = make_rotation(state.rotation);
  state.momentum = rotation * (solid.inertia_kg_m2 * (transpose(rotation) * motion.spin));
  return state;
}

/// The states of its bodies from its coordinates.
void Space::place_linked(const Linked& linked) {
  std::vector<joints::Motion> motions;
  linked.mechanism->find_motions(linked.now, motions);
  for (std::size_t k = 0; k < linked.bodies.size(); ++k) {
    const auto i = static_cast<std::size_t>(linked.bodies[k]);
    states_[i] = make_state(solids_[i], motions[k]);
    check_finite(linked.bodies[k]);
    place_body(linked.bodies[k]);
  }
}

/// One that may meet something keeps all of its mechanism from flying.
void Space::activate_linked(std::vector<char>& active) const {
  for (const Linked& linked : linked_) {
    const bool any =
        std::any_of(linked.bodies.begin(), linked.bodies.end(), [&](int body) { return active[static_cast<std::size_t>(body)] != 0; });
    if (any)
      for (const int body : linked.bodies) active[static_cast<std::size_t>(body)] = 1;
  }
}

/// Takes the mechanisms that meet nothing to the end of the window, or puts them to sleep.
void Space::fly_windows_of_linked(const std::vector<char>& active, double length_s) {
  for (Linked& linked : linked_) {
    const int first = linked.bodies.front();
    if (!moves(first) || active[static_cast<std::size_t>(first)] || !options_.islands) continue;
    if (linked.hangs && may_rest({linked.bodies, {}}, length_s) && is_in_balance(linked)) {
      stop_linked({linked.bodies, {}});
      for (const int body : linked.bodies) asleep_[static_cast<std::size_t>(body)] = 1;
      continue;
    }
    linked.flew_from = linked.now;
    linked.now = fly_linked(linked, linked.now, length_s);
    place_linked(linked);
    ++costs_.flights;
    for (const int body : linked.bodies) flying_[static_cast<std::size_t>(body)] = 1;
    costs_.body_steps += static_cast<std::int64_t>(linked.bodies.size());
  }
}

/// How much faster than gravity makes it any point of it may get [m/s^2]: twice what the joints do now.
double Space::calc_linked_pull(const Linked& linked) const {
  std::vector<joints::Spatial> rates;
  linked.mechanism->find_accelerations(linked.now, rates);
  double max = 0.0;
  for (std::size_t k = 0; k < rates.size(); ++k)
    max = std::max(max, norm(rates[k].linear) + norm(rates[k].angular) * solid(linked.bodies[k]).radius_m);
  return 2.0 * max;
}

/// Would it stay where it is if it had no velocity, without contacts?
bool Space::is_in_balance(const Linked& linked) const {
  joints::Coordinates still = linked.now;
  std::fill(still.u.begin(), still.u.end(), 0.0);
  std::vector<joints::Spatial> rates;
  linked.mechanism->find_accelerations(still, rates);
  const double g = std::max(norm(gravity_), 1e-9);
  for (std::size_t k = 0; k < rates.size(); ++k)
    if (norm(rates[k].linear) + norm(rates[k].angular) * solid(linked.bodies[k]).radius_m >= kBalanced * g) return false;
  return true;
}

/// Takes the velocities of the mechanisms of a group; what they had of energy is lost.
void Space::stop_linked(const Island& island) {
  for_linked(island, [&](Linked& linked) {
    for (const int body : linked.bodies) lost_j_ += calc_kinetic(solid(body), state(body));
    std::fill(linked.now.u.begin(), linked.now.u.end(), 0.0);
    place_linked(linked);
  });
}

void Space::predict_linked(Linked& linked, double h, bool at_rest) {
  joints::Coordinates from = linked.now;
  if (at_rest) std::fill(from.u.begin(), from.u.end(), 0.0);
  linked.free = fly_linked(linked, from, h);
  linked.push.clear();
  ++costs_.flights;
  linked.linkage.set(*linked.mechanism, linked.free);
  linked.linkage.movers.clear();
  std::vector<joints::Motion> motions;
  linked.mechanism->find_motions(linked.free, motions);
  for (std::size_t k = 0; k < linked.bodies.size(); ++k) {
    const auto i = static_cast<std::size_t>(linked.bodies[k]);
    const int index = index_[i];
    const auto n = static_cast<std::size_t>(index);
    linked.linkage.movers.push_back(index);
    free_[n] = place(solids_[i], make_state(solids_[i], motions[k]));
    free_spin_[n] = motions[k].spin;
    free_centre_[n] = motions[k].centre;
    free_velocity_[n] = motions[k].velocity;
    movers_[n] = {1.0 / solids_[i].mass_kg, free_[n].inverse_inertia, motions[k].velocity,
                  motions[k].spin,          &linked.linkage,          static_cast<int>(k)};
  }
}

/// What the points of the step do to the velocities of the mechanisms.
void Space::push_linked(const Island& island) {
  for_linked(island, [&](Linked& linked) {
    std::vector<joints::Spatial> impulses(linked.bodies.size());
    bool any = false;
    const auto add = [&](int index, const Vec3& arm, const Vec3& impulse, const Vec3& couple) {
      if (index < 0 || movers_[static_cast<std::size_t>(index)].linkage != &linked.linkage) return;
      joints::Spatial& on = impulses[static_cast<std::size_t>(movers_[static_cast<std::size_t>(index)].member)];
      on.linear = on.linear + impulse;
      on.angular = on.angular + cross(arm, impulse) + couple;
      any = any || impulse != Vec3{} || couple != Vec3{};
    };
    for (const Point& p : points_) {
      add(p.a, p.arm_a, p.impulse, p.couple);
      add(p.b, p.arm_b, -1.0 * p.impulse, -1.0 * p.couple);
    }
    linked.push.clear();
    if (any) linked.push = linked.mechanism->calc_push(linked.free, impulses);
  });
}

/// A part of the step on: what the contacts gave it acts all along.
joints::Coordinates Space::calc_linked_moved(const Linked& linked, double part_s, double step_s) const {
  joints::Coordinates flown = part_s == step_s ? linked.free : fly_linked(linked, linked.now, part_s);
  if (linked.push.empty()) return flown;
  return linked.mechanism->move(flown, linked.push, part_s / step_s, 0.5 * part_s * part_s / step_s);
}

/// Impulses at once, of an impact.
void Space::give_linked(Linked& linked, const std::vector<joints::Spatial>& impulses) {
  linked.now = linked.mechanism->move(linked.now, linked.mechanism->calc_push(linked.now, impulses), 1.0, 0.0);
  place_linked(linked);
}

/// Velocity and spin that a body gains per impulse and couple on itself.
impact::Mobility Space::calc_own_mobility(const Linked& linked, int member) const {
  const std::vector<double> column = linked.mechanism->calc_mobility(linked.now, member);
  impact::Mobility own{};
  for (std::size_t r = 0; r < 6; ++r)
    for (std::size_t c = 0; c < 6; ++c) own[r][c] = column[36 * static_cast<std::size_t>(member) + 6 * r + c];
  return own;
}

/// The mechanism of a body that an impact with modes has moved on by `time_s`, of which the contacts of the step have their part.
void Space::advance_linked_ringing(Linked& linked, const impact::Body& struck, double time_s, double step_s) {
  const auto calc = [&] {
    double kinetic = 0.0, all = linked.now.lost_j;
    for (const int body : linked.bodies) {
      kinetic += calc_kinetic(solid(body), state(body));
      all += rigid::calc_energy(solid(body), state(body), gravity_);
    }
    return std::pair(kinetic, all);
  };
  const double before = calc().second;
  joints::Coordinates moved = fly_linked(linked, linked.now, time_s);
  std::vector<joints::Spatial> impulses(linked.bodies.size()), shifts(linked.bodies.size());
  const auto member = static_cast<std::size_t>(linked.ringing);
  impulses[member] = {struck.impulse_n_s, struck.couple_n_m_s};
  shifts[member] = {struck.shift_n_s2, struck.turning_n_m_s2};
  const std::vector<double> du = linked.mechanism->calc_push(moved, impulses), dq = linked.mechanism->calc_push(moved, shifts);
  moved = linked.mechanism->move(moved, dq, 0.0, 1.0);
  moved = linked.mechanism->move(moved, du, 1.0, 0.0);
  if (!linked.push.empty()) moved = linked.mechanism->move(moved, linked.push, time_s / step_s, 0.5 * time_s * time_s / step_s);
  linked.now = std::move(moved);
  place_linked(linked);
  if (!linked.push.empty() || !linked.hangs) return;
  // The impact has taken its mobility for constant: the difference of the motion's energy from the contacts' work is corrected, as a change
  // of all its velocities by the same part.
  const auto [kinetic, after] = calc();
  const double gained = after - before - struck.work_j;
  if (!(std::abs(gained) < kRight * kinetic)) return;
  const double part = std::sqrt(1.0 - gained / kinetic);
  for (double& u : linked.now.u) u *= part;
  place_linked(linked);
}

}  // namespace carillon::rigid
