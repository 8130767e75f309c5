// Modes of bodies between impacts.
#pragma once

#include <map>
#include <vector>

#include "runtime/physics/rigid/bodies.hpp"
#include "runtime/physics/rigid/contact.hpp"

namespace carillon::rigid {

/// Modal state of a body at a time; empty: at rest since the start.
struct ModalState {
  std::vector<double> q, q_dot;
  double time_s = 0.0;
};

/// Position of a hit on a body's surface; searched once.
const geometry::Place& find_place(const Bodies& bodies, Hit& hit, bool is_a);
/// (n, 3) mode shapes at a hit, mesh axes. The body must have modes.
std::vector<double> find_shape(const Bodies& bodies, Hit& hit, bool is_a);

/// (n) amplitudes of freely vibrating modes.
std::vector<double> calc_amplitudes(const impact::Modes& modes, const std::vector<double>& q, const std::vector<double>& q_dot);
/// Stores the bound of a body's surface displacement by modes (Bodies::get_swing()).
void note_swing(Bodies& bodies, int body, const std::vector<double>& q, const std::vector<double>& q_dot);

/// Modal states of all bodies with modes. A modal impact owns those of its bodies until it returns them (set()).
class ModalStates {
 public:
  ModalStates(Bodies& bodies, Ledger& ledger) : bodies_(bodies), ledger_(ledger), states_(bodies) {}

  /// Advances freely to a time, unless it is later already; books damping losses.
  ModalState& advance(int body, double time_s);
  /// Returns the modes of a body, without damping, to a time that they have passed.
  void turn_back(int body, double time_s);
  const ModalState& get(int body) const { return states_[body]; }
  void set(int body, ModalState state) {
    states_[body] = std::move(state);
    note_swing(bodies_, body, states_[body].q, states_[body].q_dot);
  }
  /// Excites modes by the pulses of a rigid impact, with at most `available_j`, the loss of the motion; the remainder is booked as lost.
  void excite(Strike& strike, double available_j);
  /// Takes up to `energy_j` from the modes of a body by reducing all amplitudes; returns the energy taken.
  double take(int body, double energy_j);
  /// Adds energies at a time, and losses until then.
  void add_to(Books& books, double time_s) const;

 private:
  double add_pulses(Strike& strike, std::map<int, ModalState>& before);

  Bodies& bodies_;
  Ledger& ledger_;
  PerBody<ModalState> states_;
};

}  // namespace carillon::rigid
