// Test whether the plain Hertz pulse suffices for an impact, and that pulse.
#pragma once

#include <span>

#include "runtime/physics/impact/modes.hpp"
#include "runtime/physics/impact/spring.hpp"

namespace carillon::impact {

/// |P(x)|^2 of the pulse sin^1.5 of unit area, x = w tau: fraction of the squared impulse that a mode receives. From a table of 513 values
/// up to x = 96, 0 beyond (below 1e-7 there). Pure.
double calc_pulse_spectrum(double x);

/// One side of a contact: modes, shape values along the normal (n) [1/sqrt(kg)] and modal state there (n each, or empty: at rest).
struct Side {
  const Modes* modes = nullptr;
  std::span<const double> phi, q, q_dot;
};

struct Prediction {
  bool is_enough = false;    // false: integrate (impact.hpp)
  double length_s = 0.0;     // tau of Hertz
  double modal_j = 0.0;      // energy that the modes of both bodies would receive, with (1 + e)/2 of the elastic impulse
  double restitution = 0.0;  // min(e, sqrt(1 - modal_j/(m v^2/2)))
  double impulse_n_s = 0.0;  // (1 + restitution) m v
};

/// Predicts the impact of the reduced mass m [kg] at the approach speed v [m/s] with the given restitution, as one Hertz pulse on rigid
/// bodies: E_H = 1/2 J^2 sum phi_i^2 |P(w_i tau)|^2, J = 2 m v, of both bodies and of the modes above their bands (modes.hpp). Sufficient
/// if E_H < 0.02 m v^2/2 (then the restitution is wrong by less than 0.01, as a loss is 1 - e^2), the exponent is 1.5 and neither body
/// vibrates at the point with more than 1 % of v (amplitudes added).
Prediction predict(const Spring& spring, double mass_kg, double speed_m_s, double restitution, const Side& a, const Side& b);

}  // namespace carillon::impact
