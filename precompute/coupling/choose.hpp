// Choice of the modes coupled by nonlinear strain.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/coupling/strains.hpp"
#include "precompute/la/block_kernels.hpp"

namespace carillon::coupling {

/// Minimum ratio of rms rotation to rms strain of modes that bend or twist a slender part: wavelengths above 3.8 thicknesses of a plate.
/// The others stretch or shear it.
inline constexpr double kSlender = 3.0;

/// (modes) root of the integral of rotation² over that of strain². Collective.
std::vector<double> calc_slenderness(const comm::Communicator& comm, const Strains& strains, const mesh::LocalMesh& local,
                                     const la::Columns& shapes);

struct Choice {
  std::vector<std::int32_t> modes;  // ascending
  double top_hz = 0;                // frequency of the highest coupled mode
  double membrane_hz = 0;           // lowest mode that stretches or shears; 0: unknown
  std::int64_t bending_count = 0;   // bending or twisting modes up to the limit, chosen or not
  bool splits_pair = false;         // the last mode was omitted because its degenerate partner did not fit
};

/// The lowest `count` bending or twisting modes of `eligible` (ascending) up to below_hz: they have the largest displacement for a given
/// impulse and dominate the pitch glide. Degenerate modes stay together. freq_hz, slenderness: of all modes. Pure.
Choice choose_modes(std::span<const double> freq_hz, std::span<const double> slenderness, std::span<const std::int32_t> eligible, int count,
                    double below_hz);

}  // namespace carillon::coupling
