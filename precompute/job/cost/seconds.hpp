// Predicted run time.
#pragma once

#include "precompute/job/cost/problem_size.hpp"

namespace carillon::cost {

/// CPU seconds of all ranks, or wall-clock seconds, by phase.
struct PhaseSeconds {
  double read = 0;
  double partition = 0;
  double assemble = 0;
  double analyse = 0;
  double factor = 0;  // all factorisations
  double solve = 0;   // triangular solves
  double orthogonalise = 0;
  double check = 0;  // residuals, orthonormality
  double errors = 0;
  double coupling = 0;  // quartic energy of coupled modes
  double collect = 0;
  double air = 0;
  double write = 0;

  double sum_modes() const { return analyse + factor + solve + orthogonalise + check; }
  double sum() const { return read + partition + assemble + sum_modes() + errors + coupling + collect + air + write; }
};

/// CPU seconds on the calibration machine. Unknown sizes are estimated.
PhaseSeconds predict_seconds(const ProblemSize& size);

/// Right-hand sides for the quartic energy of this many coupled modes.
double predict_coupling_solves(int modes);

/// Wall clock of CPU seconds on `ranks` ranks with a core each: single-rank work stays, the rest is divided.
PhaseSeconds calc_wall(const PhaseSeconds& cpu, const ProblemSize& size, int ranks);

}  // namespace carillon::cost
