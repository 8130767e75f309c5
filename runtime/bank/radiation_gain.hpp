// How loud a mode is: its radiation gain from the motion of the outer surface. Equations: docs/equations.md, radiation.
#pragma once

#include <span>

#include "runtime/bank/bank.hpp"

namespace carillon::bank {

/// Calculates the pressure amplitude at 1 m [Pa] for unit modal velocity (q' = 1 m kg^1/2 / s):
///   g = rho0 omega / (4 pi sqrt(1 + (k a)^2)) * flow,   k = omega / c0,  a = sqrt(A / 4 pi),
/// flow: the sum over outer triangles of |integral phi . n dA| [m^2 kg^-1/2], phi linear over each triangle; A: their area [m^2].
/// Exact for a pulsating sphere. OSG02 section 3.4 with absolute values, because the signed sum is zero for a bending mode of a symmetric
/// body. Directions and interference are left out: too loud for modes whose lobes are short against the wavelength.
double calc_radiation_gain(double omega_rad_s, double flow, double area_m2);

/// Gives the bank its gains: calc_radiation_gain() of its eigenvalues and the flow of its outer surface. `shapes`: (V, m, 3) [kg^-1/2],
/// not rounded to steps.
void set_radiation_gains(Bank& bank, std::span<const double> shapes);

/// The area of the triangles that face the open air [m^2].
double calc_outer_area_m2(const Bank& bank);

}  // namespace carillon::bank
