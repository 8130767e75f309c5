// Which modes of a body are coupled by its nonlinear strain.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "precompute/comm/communicator.hpp"
#include "precompute/coupling/strains.hpp"
#include "precompute/la/block_kernels.hpp"

namespace carillon::coupling {

/// Modes whose rotation is three times their strain or more, in the root of the mean square over the body, bend or twist something slender:
/// waves longer than 3.8 thicknesses of a plate. The others stretch or shear it.
inline constexpr double kSlender = 3.0;

/// (modes) root of the integral of rotation² over that of strain². Collective.
std::vector<double> calc_slenderness(const comm::Communicator& comm, const Strains& strains, const mesh::LocalMesh& local,
                                     const la::Columns& shapes);

struct Choice {
  std::vector<std::int32_t> modes;  // ascending
  double top_hz = 0;                // of the highest one
  double membrane_hz = 0;           // of the lowest mode that stretches or shears; 0: none is known
  std::int64_t bending_count = 0;   // modes that bend or twist up to the limit, chosen or not
  bool splits_pair = false;         // the last was left out because its like, of the same frequency, did not fit
};

/// The lowest `count` modes of `eligible` (ascending) that bend or twist, up to below_hz: with the same blow they move furthest, and they
/// are what is heard to glide. Two modes of one frequency go together. freq_hz, slenderness: of all modes. Pure.
Choice choose_modes(std::span<const double> freq_hz, std::span<const double> slenderness, std::span<const std::int32_t> eligible, int count,
                    double below_hz);

}  // namespace carillon::coupling
