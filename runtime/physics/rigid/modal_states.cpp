// Method: free motion in closed form (runtime/physics/impact/modes.hpp); excitation by rigid impacts from the pulse spectrum.
// Source: docs/decisions/impact.md.
#include "runtime/physics/rigid/modal_states.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "runtime/physics/impact/predict.hpp"
#include "runtime/physics/rigid/limits.hpp"

namespace carillon::rigid {
namespace {

constexpr double kMaxStretch = 1e3;     // of the second pulse,
constexpr double kStretchStep = 1.3;    // in steps
constexpr double kFirstRatio = 0.25;    // of the available energy: given by the first of two pulses
constexpr double kMaxShapeValue = 4.0;  // largest mode shape value times sqrt(mass): at the corners of a plate

}  // namespace

const geometry::Place& find_place(const Bodies& bodies, Hit& hit, bool is_a) {
  const int side = is_a ? 0 : 1, body = is_a ? hit.a : hit.b;
  std::optional<geometry::Place>& place = hit.places[side];
  if (place) return *place;
  const Mat3 back = transpose(bodies.placed(body).rotation);
  place = bodies.get_shape(body)->find_place(bodies.solid(body).centre_m + back * (hit.touch.where_m - bodies.state(body).centre),
                                             back * ((is_a ? -1.0 : 1.0) * hit.touch.normal), hit.triangles[side]);
  hit.triangles[side] = place->triangle;
  return *place;
}

std::vector<double> find_shape(const Bodies& bodies, Hit& hit, bool is_a) {
  return bodies.solid(is_a ? hit.a : hit.b).find_shape(find_place(bodies, hit, is_a));
}

ModalState& ModalStates::advance(int body, double time_s) {
  ModalState& state = states_[body];
  const impact::Modes& modes = *bodies_.solid(body).modes;
  if (state.q.empty()) {
    state.q.assign(modes.size(), 0.0);
    state.q_dot.assign(modes.size(), 0.0);
    state.time_s = std::max(time_s, state.time_s);
  }
  if (time_s > state.time_s) {
    const double before = modes.calc_energy(state.q, state.q_dot);
    if (before > 0.0) modes.move_freely(state.q, state.q_dot, time_s - state.time_s);
    ledger_.lose(before - modes.calc_energy(state.q, state.q_dot));
    state.time_s = time_s;
    note_swing(bodies_, body, state.q, state.q_dot);
  }
  return state;
}

void ModalStates::turn_back(int body, double time_s) {
  ModalState& state = states_[body];
  if (state.q.empty() || !(state.time_s > time_s)) return;
  bodies_.solid(body).modes->turn(state.q, state.q_dot, time_s - state.time_s);
  state.time_s = time_s;
}

std::vector<double> calc_amplitudes(const impact::Modes& modes, const std::vector<double>& q, const std::vector<double>& q_dot) {
  const std::vector<double>& omega = modes.get_omega();
  std::vector<double> amplitudes(q.size());
  for (std::size_t m = 0; m < q.size(); ++m) amplitudes[m] = omega[m] > 0.0 ? std::hypot(q[m], q_dot[m] / omega[m]) : 0.0;
  return amplitudes;
}

void note_swing(Bodies& bodies, int body, const std::vector<double>& q, const std::vector<double>& q_dot) {
  double sum = 0.0;
  for (const double amplitude : calc_amplitudes(*bodies.solid(body).modes, q, q_dot)) sum += amplitude;
  bodies.set_swing(body, kMaxShapeValue / std::sqrt(bodies.solid(body).mass_kg) * sum);
}

void ModalStates::excite(Strike& strike, double available_j) {
  std::map<int, ModalState> before;  // bodies whose modes are struck
  const Ledger ledger_before = ledger_;
  double given = add_pulses(strike, before);
  const auto undo = [&] {
    for (auto& [body, state] : before) set(body, std::move(state));
    before.clear();
    ledger_ = ledger_before;
  };
  // Bodies that bend far: their surface is stopped at once, but the body slowly, by modes that get no more than the motion loses.
  const bool bends = std::any_of(strike.hits.begin(), strike.hits.end(), [](const Hit& hit) { return hit.bends; });
  if (bends && given > available_j) strike.first_share = std::sqrt(kFirstRatio * std::max(available_j, 0.0) / given);
  while (bends && given > available_j && strike.stretch < kMaxStretch) {
    undo();
    strike.stretch *= kStretchStep;
    given = add_pulses(strike, before);
  }
  if (given > std::max(available_j, 0.0)) {
    undo();  // rigid impacts are only used if modes receive almost no energy
    given = 0.0;
  }
  for (const auto& [body, state] : before) note_swing(bodies_, body, states_[body].q, states_[body].q_dot);
  strike.modes_j = given;
  ledger_.lose(available_j - given);
}

/// Returns the energy given to the modes, and their states before.
double ModalStates::add_pulses(Strike& strike, std::map<int, ModalState>& before) {
  double given = 0.0;
  for (Hit& hit : strike.hits) {
    if (hit.impulse == Vec3{} || hit.is_cord || !(hit.approach_m_s > kMinImpactSpeedMS)) continue;
    for (const bool is_a : {true, false}) {
      const int body = is_a ? hit.a : hit.b;
      if (!bodies_.has_modes(body) || bodies_.is_in_impact(body)) continue;
      const Vec3 impulse = transpose(bodies_.placed(body).rotation) * ((is_a ? 1.0 : -1.0) * hit.impulse);
      const std::vector<double> shape = find_shape(bodies_, hit, is_a);
      const double push = dot(hit.impulse, hit.touch.normal);
      const double mass = push > 0.0 ? push / ((1.0 + hit.restitution) * hit.approach_m_s) : 0.0;
      if (!(mass > 0.0)) continue;
      const double length = bodies_.calc_contact_time(hit.touch, hit.a, hit.b, mass, hit.approach_m_s);
      before.try_emplace(body, states_[body]);
      ModalState& state = advance(body, strike.time_s);
      const impact::Modes& modes = *bodies_.solid(body).modes;
      const auto& omega = modes.get_omega();
      const double energy = modes.calc_energy(state.q, state.q_dot);
      for (int m = 0; m < modes.size(); ++m)
        state.q_dot[m] += (shape[3 * m] * impulse[0] + shape[3 * m + 1] * impulse[1] + shape[3 * m + 2] * impulse[2]) *
                          (strike.first_share * std::sqrt(impact::calc_pulse_spectrum(omega[m] * length)) +
                           (1.0 - strike.first_share) * std::sqrt(impact::calc_pulse_spectrum(omega[m] * strike.prolong(length))));
      given += modes.calc_energy(state.q, state.q_dot) - energy;
    }
  }
  return given;
}

double ModalStates::take(int body, double energy_j) {
  if (!bodies_.has_modes(body) || states_[body].q.empty() || bodies_.is_in_impact(body)) return 0.0;
  ModalState& state = advance(body, bodies_.get_time());
  const double all_j = bodies_.solid(body).modes->calc_energy(state.q, state.q_dot), taken_j = std::min(energy_j, all_j);
  if (!(taken_j > 0.0)) return 0.0;
  const double part = std::sqrt(1.0 - taken_j / all_j);
  for (double& q : state.q) q *= part;
  for (double& q_dot : state.q_dot) q_dot *= part;
  note_swing(bodies_, body, state.q, state.q_dot);
  return taken_j;
}

void ModalStates::add_to(Books& books, double time_s) const {
  for (int i = 0; i < bodies_.count(); ++i) {
    const ModalState& state = states_[i];
    if (!bodies_.has_modes(i) || state.q.empty() || bodies_.is_in_impact(i)) continue;
    const impact::Modes& modes = *bodies_.solid(i).modes;
    std::vector<double> q = state.q, q_dot = state.q_dot;
    const double before = modes.calc_energy(q, q_dot);
    if (before > 0.0 && time_s > state.time_s) modes.move_freely(q, q_dot, time_s - state.time_s);
    const double now = modes.calc_energy(q, q_dot);
    books.modes_j += now;
    books.lost_j += before - now;
  }
}

}  // namespace carillon::rigid
