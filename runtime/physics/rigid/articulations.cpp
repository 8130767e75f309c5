// Method: bodies on joints move in the coordinates of their mechanism, so joints stay closed to rounding.
#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>

#include "runtime/base/error.hpp"
#include "runtime/base/groups.hpp"
#include "runtime/physics/rigid/bodies.hpp"
#include "runtime/physics/rigid/limits.hpp"

namespace carillon::rigid {

/// One articulation per group of bodies connected by joints. Fixed bodies count as the world.
void Bodies::make_articulations(const std::vector<joints::Joint>& joints) {
  if (joints.empty()) return;
  articulation_of_.assign(solids_.size(), -1);
  member_.assign(solids_.size(), -1);
  base::Groups groups(count());
  std::vector<char> has_joint(solids_.size(), 0);
  for (const joints::Joint& joint : joints) {
    if (joint.body >= 0 && joint.to >= 0) joined_.insert(std::minmax(joint.body, joint.to));
    for (const int body : {joint.body, joint.to})
      if (!is_fixed(body)) has_joint[body] = 1;
    if (!is_fixed(joint.body) && !is_fixed(joint.to)) groups.join(joint.body, joint.to);
  }
  for (int i = 0; i < count(); ++i) {
    if (!has_joint[i]) continue;
    int& of = articulation_of_[groups.find(i)];
    if (of < 0) {
      of = static_cast<int>(articulations_.size());
      articulations_.emplace_back();
    }
    articulation_of_[i] = of;
    std::vector<int>& bodies = articulations_[of].bodies;
    member_[i] = static_cast<int>(bodies.size());
    bodies.push_back(i);
  }
  for (Articulation& articulation : articulations_) {
    std::vector<joints::Member> members;
    for (const int i : articulation.bodies)
      members.push_back(
          {solids_[i].mass_kg, solids_[i].inertia_kg_m2, {states_[i].centre, states_[i].velocity, states_[i].rotation, placed_[i].spin}});
    std::vector<joints::Joint> own;
    for (joints::Joint joint : joints) {
      if (find_articulation(is_fixed(joint.body) ? joint.to : joint.body) != &articulation) continue;
      joint.body = is_fixed(joint.body) ? -1 : get_member(joint.body);
      joint.to = is_fixed(joint.to) ? -1 : get_member(joint.to);
      articulation.is_anchored = articulation.is_anchored || joint.body < 0 || joint.to < 0;
      own.push_back(joint);
    }
    articulation.mechanism = joints::make_mechanism(members, own, gravity_);
    articulation.now = articulation.mechanism->get_start();
    place(articulation);
  }
}

double Bodies::get_start_error(int body) const {
  const Articulation* articulation = find_articulation(body);
  return articulation != nullptr ? articulation->mechanism->get_start_error() : 0.0;
}

joints::Coordinates Bodies::fly(const Articulation& articulation, const joints::Coordinates& from, double time_s) const {
  try {
    return articulation.mechanism->fly(from, time_s, joint_tolerance_);
  } catch (const std::runtime_error& error) {
    throw SolveError(
        fmt::format("bodies on joints, among them body {}, after {:.6f} s: {}", articulation.bodies.front(), time_s_, error.what()));
  }
}

State Bodies::make_member_state(int body, const joints::Motion& motion) const {
  State state;
  state.centre = motion.centre;
  state.velocity = motion.velocity;
  state.rotation = motion.rotation;
  const Mat3 rotation = make_rotation(state.rotation);
  state.momentum = rotation * (solids_[body].inertia_kg_m2 * (transpose(rotation) * motion.spin));
  return state;
}

void Bodies::place(const Articulation& articulation) {
  std::vector<joints::Motion> motions;
  articulation.mechanism->find_motions(articulation.now, motions);
  for (int k = 0; const int body : articulation.bodies) {
    states_[body] = make_member_state(body, motions[k++]);
    place(body);
  }
}

void Bodies::apply_impulses(Articulation& articulation, const std::vector<joints::Spatial>& impulses) {
  articulation.now =
      articulation.mechanism->move(articulation.now, articulation.mechanism->calc_push(articulation.now, impulses), 1.0, 0.0);
  place(articulation);
}

double Bodies::calc_joint_acceleration(const Articulation& articulation) const {
  std::vector<joints::Spatial> rates;
  articulation.mechanism->find_accelerations(articulation.now, rates);
  double max = 0.0;
  for (int k = 0; const int body : articulation.bodies) {
    max = std::max(max, norm(rates[k].linear) + norm(rates[k].angular) * solids_[body].radius_m);
    ++k;
  }
  return 2.0 * max;
}

bool Bodies::is_balanced(const Articulation& articulation) const {
  joints::Coordinates still = articulation.now;
  std::fill(still.u.begin(), still.u.end(), 0.0);
  std::vector<joints::Spatial> rates;
  articulation.mechanism->find_accelerations(still, rates);
  const double g = std::max(norm(gravity_), 1e-9);
  for (int k = 0; const int body : articulation.bodies) {
    if (norm(rates[k].linear) + norm(rates[k].angular) * solids_[body].radius_m >= kRestResidualRatio * g) return false;
    ++k;
  }
  return true;
}

impact::Mobility Bodies::calc_own_mobility(const Articulation& articulation, int member) const {
  const std::vector<double> column = articulation.mechanism->calc_mobility(articulation.now, member);
  impact::Mobility own{};
  for (int r = 0; r < 6; ++r)
    for (int c = 0; c < 6; ++c) own[r][c] = column[36 * member + 6 * r + c];
  return own;
}

}  // namespace carillon::rigid
