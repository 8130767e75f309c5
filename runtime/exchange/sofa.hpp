// Radiation of a bank's modes as a SOFA file of the convention FreeFieldDirectivityTF.
#pragma once

#include <cstddef>
#include <optional>
#include <string>

#include "runtime/bank/bank.hpp"

namespace carillon::exchange {

struct SofaOptions {
  std::string name = "body";
  double distance_m = 1.0;  // of the receivers from the centre of the multipoles
  double step_deg = 10.0;   // between receivers, in azimuth and elevation; divides 180
  /// Blow of 1 N s along the inward normal, mesh axes, moved to the surface; empty: unit modal velocities (1 m kg^1/2 / s).
  std::optional<Vec3> strike_m{};
  bool has_bands = false;  // third octaves of the blow (IEC 61260, base ten) instead of modes
};

struct SofaFile {
  std::string bytes;
  std::size_t receivers = 0, frequencies = 0;
};

/// Pressures as radiation::Transfers, at receivers on a sphere, x of the mesh ahead and z up; frequencies in ascending order, time factor
/// e^{+i omega t} as in SOFA. A third octave has the root of the sum of |pressure|^2 of its modes, phase 0. Throws InputError for a bank
/// without multipoles, and for options out of range.
SofaFile make_sofa(const bank::Bank& bank, const SofaOptions& options);

}  // namespace carillon::exchange
