#pragma once

namespace carillon::nonlinear {

/// Linear constants of a coupled mode.
struct ModeConstants {
  double eigenvalue_rad2_s2 = 0.0;
  double decay_per_s = 0.0;
};

}  // namespace carillon::nonlinear
