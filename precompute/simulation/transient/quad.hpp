// Common types of the full-order motion: nodal value, material law. Std only.
#pragma once

#include <cstdint>

namespace carillon::transient {

/// Displacement [m], velocity [m/s] or force [N] of one node, as one vector load. w is always 0.
struct alignas(32) Quad {
  double x = 0.0, y = 0.0, z = 0.0, w = 0.0;
};

/// St. Venant-Kirchhoff with strain-rate damping (O'Brien, Cook and Essl 2001; O'Brien, Shen and Gatchalian 2002): S = lambda tr(E) I + 2
/// mu E + phi tr(E') I + 2 psi E'. phi = alpha1 lambda, psi = alpha1 mu is Rayleigh damping at small amplitude.
struct Law {
  double lambda_pa = 0.0;
  double mu_pa = 0.0;
  double phi_pa_s = 0.0;  // phi and psi zero: loops without damping
  double psi_pa_s = 0.0;
  double density_kg_m3 = 0.0;

  bool is_damped() const { return phi_pa_s != 0.0 || psi_pa_s != 0.0; }
};

}  // namespace carillon::transient
