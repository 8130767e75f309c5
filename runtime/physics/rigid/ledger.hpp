// Energy balance of a simulation and cost of its steps.
#pragma once

#include <cstdint>

namespace carillon::rigid {

/// Current energies, and energies lost, lifted or given since the start [J]; their total is constant.
struct Books {
  double motion_j = 0.0;   // kinetic and gravitational
  double modes_j = 0.0;    // in the bodies' modes
  double springs_j = 0.0;  // of current modal impacts, and energy for lifting in the next step
  double lost_j = 0.0;     // by friction, in contacts, by modal damping, above the bands
  double lifted_j = 0.0;   // given to bodies that were moved apart, beyond the share paid by their motion

  double given_j = 0.0;  // from outside: pushes, grabs, bodies added or removed

  double calc_total() const { return motion_j + modes_j + springs_j + lost_j - lifted_j - given_j; }
};

struct Costs {
  std::int64_t steps = 0;       // small steps, and windows with free flight only
  std::int64_t body_steps = 0;  // summed over steps: number of moved bodies
  std::int64_t solves = 0, sweeps = 0, searches = 0, impacts = 0;
  std::int64_t flights = 0;        // of mechanisms: integrations of free motion
  std::int64_t pushes = 0;         // displacements of islands with deep penetrations
  std::int64_t ended_impacts = 0;  // modal impacts ended before their contacts separated
  double longest_impact_s = 0.0;   // of completed modal impacts
};

/// Losses and costs of all stages. Energies of bodies, modes and springs are summed from their states on request. Invariant: a stage that
/// removes energy from them books it here, so that the sum of the Books is constant.
class Ledger {
 public:
  /// Negative: an energy gain [J].
  void lose(double energy_j) { lost_j_ += energy_j; }
  void lift(double energy_j) { lifted_j_ += energy_j; }
  void give(double energy_j) { given_j_ += energy_j; }
  /// Adds losses and gains to the books.
  void add_to(Books& books) const {
    books.lost_j += lost_j_;
    books.lifted_j += lifted_j_;
    books.given_j += given_j_;
  }

  Costs costs;

 private:
  double lost_j_ = 0.0, lifted_j_ = 0.0, given_j_ = 0.0;
};

}  // namespace carillon::rigid
