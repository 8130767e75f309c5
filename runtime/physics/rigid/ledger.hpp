// The energy of a simulation and the cost of its steps.
#pragma once

#include <cstdint>

namespace carillon::rigid {

/// Energies now, or lost or lifted since the beginning [J]; their total is constant.
struct Books {
  double motion_j = 0.0;   // kinetic and of gravity
  double modes_j = 0.0;    // in the bodies' modes
  double springs_j = 0.0;  // of impacts with modes that are not over
  double lost_j = 0.0;     // by friction, in contacts, in the modes' damping, above their bands
  double lifted_j = 0.0;   // given to bodies that were moved apart, beyond the payment of their motion

  double calc_total() const { return motion_j + modes_j + springs_j + lost_j - lifted_j; }
};

struct Costs {
  std::int64_t steps = 0;       // small steps, and windows in which bodies only flew
  std::int64_t body_steps = 0;  // of each, the bodies that moved
  std::int64_t solves = 0, sweeps = 0, searches = 0, impacts = 0;
  std::int64_t flights = 0;        // of mechanisms: integrations of their free motion
  std::int64_t pushes = 0;         // displacements of islands whose bodies were too deep
  std::int64_t ended_impacts = 0;  // with modes, before their contacts had parted
  double longest_impact_s = 0.0;   // with modes, that is over
};

/// Losses and costs of all stages. Energies that bodies, modes and springs hold are summed from these when they are asked for. Invariant: a
/// stage that takes energy from them books it here, so that the sum of the Books is constant.
class Ledger {
 public:
  /// Negative: energy from nowhere [J].
  void lose(double energy_j) { lost_j_ += energy_j; }
  void lift(double energy_j) { lifted_j_ += energy_j; }
  /// Adds losses and gains to the books.
  void add_to(Books& books) const {
    books.lost_j += lost_j_;
    books.lifted_j += lifted_j_;
  }

  Costs costs;

 private:
  double lost_j_ = 0.0, lifted_j_ = 0.0;
};

}  // namespace carillon::rigid
