// Surface pressure of a moving surface by a one-pole model (docs/equations.md E14).
#pragma once

#include <array>

namespace carillon::recording {

inline constexpr int kPoleTaps = 32;

/// For a body with the surface area of a sphere of radius a: P, the part of the volume velocity that makes pressure, follows the volume
/// acceleration g of a triangle by dP/dt + (c/a) P = g [m3/s]; surface pressure times area is z P. Exact for g without content near half
/// the sample rate: P_{k+1} = keep P_k + the sum over j of weight[j] g_{k - 15 + j}.
struct Pole {
  double rate_per_s = 0.0;  // c / a
  double keep = 0.0;
  std::array<double, kPoleTaps> weight{};
};

/// Pre: radius, rate and speed are positive.
Pole make_pole(double radius_m, double sample_rate_hz, double sound_speed_m_s);

}  // namespace carillon::recording
