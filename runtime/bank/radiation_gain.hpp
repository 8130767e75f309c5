// Radiation gains of modes from the motion of the outer surface. Equations: docs/equations.md, radiation.
#pragma once

#include <span>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

/// Pressure amplitude at 1 m [Pa] for unit modal velocity (q' = 1 m kg^1/2 / s):
///   g = rho0 omega / (4 pi sqrt(1 + (k a)^2)) * flow,   k = omega / c0,  a = sqrt(A / 4 pi),
/// flow: sum over outer triangles of |integral phi . n dA| [m^2 kg^-1/2], phi linear over each triangle; A: their area [m^2]. Exact for a
/// pulsating sphere. OSG02 section 3.4 with absolute values, since the signed sum vanishes for bending modes of symmetric bodies.
/// Directivity and interference are neglected: too loud for modes with lobes short against the wavelength.
double calc_radiation_gain(double omega_rad_s, double flow, double area_m2);

/// Sets the gains: calc_radiation_gain() of the eigenvalues and the flow of the outer surface. `shapes`: (V, m, 3) [kg^-1/2], unquantised.
void set_radiation_gains(Bank& bank, std::span<const double> shapes);

/// Area of the triangles facing the open air [m^2].
double calc_outer_area_m2(const Bank& bank);

}  // namespace carillon::bank
