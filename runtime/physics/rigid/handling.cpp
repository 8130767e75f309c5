// Bodies pushed, held, added and removed from outside.
#include <algorithm>
#include <utility>
#include <vector>

#include "runtime/physics/rigid/grab.hpp"
#include "runtime/physics/rigid/limits.hpp"
#include "runtime/physics/rigid/space.hpp"

namespace carillon::rigid {

/// Wakes a body, and restarts its time of slow motion.
void Space::stir(int body) {
  rest_.wake(body);
  rest_.reset({body});
}

void Space::push(int body, const Vec3& where, const Vec3& impulse) {
  stir(body);
  modal_impacts_.end(body, touches_);
  ledger_.give(bodies_.apply_impulse(body, {impulse, cross(where - bodies_.state(body).centre, impulse)}));
  // Closed contacts would stop a fast body only at the end of a step, too deep: now they strike.
  for (auto& [key, pair] : touches_.pairs()) {
    if (!bodies_.share_motion(key.first, body) && !(key.second >= 0 && bodies_.share_motion(key.second, body))) continue;
    for (Contact& c : pair.contacts)
      if (bodies_.calc_approach(c.touch, c.a, c.b) > kMinImpactSpeedMS) c.touching = false;
  }
}

void Space::grab(const Grab& grab) {
  stir(grab.body);
  bodies_.set_grab(grab);
}

void Space::remove(int body) {
  modal_impacts_.end(body, touches_);
  std::vector<int> woken;
  for (const auto& [key, pair] : touches_.pairs())
    if ((key.first == body || key.second == body) && pair.touches()) woken.push_back(key.first == body ? key.second : key.first);
  for (const int other : woken)
    if (bodies_.is_asleep(other)) rest_.wake(other);
  windows_.forget(body);
  touches_.forget(body);
  bodies_.drop_grab(body);
  State& state = bodies_.state(body);
  ledger_.give(-calc_energy(bodies_.solid(body), state, bodies_.gravity()));
  state.velocity = state.momentum = {};
  bodies_.place(body);
  bodies_.set_absent(body, true);
}

int Space::append(Solid solid, const State& state) {
  bodies_.append(std::move(solid), state);
  return bodies_.count() - 1;
}

void Space::add(int body, const State& state) {
  bodies_.state(body) = state;
  bodies_.place(body);
  bodies_.set_absent(body, false);
  rest_.reset({body});
  ledger_.give(calc_energy(bodies_.solid(body), state, bodies_.gravity()));
}

/// Impulses of grabs on members of articulations, for the whole step.
void Space::pull_joints(const Island& island, double length_s) {
  if (bodies_.grabs().empty() || bodies_.articulations().empty()) return;
  for (const int body : island.bodies)
    if (const Grab* grab = bodies_.find_grab(body); grab != nullptr && bodies_.find_articulation(body) != nullptr)
      ledger_.give(bodies_.apply_impulse(body, calc_grab_impulse(bodies_, *grab, length_s)));
}

/// Books the work of grabs in the completed part of a step; returns it [J].
double Space::give_pulls(const std::vector<State>& before, const std::vector<char>& in_impact, double part_s) {
  double work_j = 0.0;
  for (int n = 0; n < step_.count(); ++n)
    if (in_impact[n] == 0) work_j += step_.calc_pull_work(n, before[n], part_s);  // ModalImpacts book the others
  ledger_.give(work_j);
  return work_j;
}

}  // namespace carillon::rigid
