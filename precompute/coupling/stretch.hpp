// The mean stretch of a body whose edges are held: few fields in place of all.
#pragma once

#include "precompute/coupling/stresses.hpp"

namespace carillon::coupling {

inline constexpr std::ptrdiff_t kMaxStretchRows = 3;  // of a sheet: along both directions, and shear
/// Part of a field's energy that is in its mean over the body, from which on it counts as stretch. Fields of a body without opposite edges
/// that are held have no mean at all: forces at the surface are what a mean needs.
inline constexpr double kMeanShare = 0.2;

/// (count) of the first fields: energy of the mean over the body, 0 to 1. fields: with values. Collective.
la::Vector calc_mean_shares(const CoupledBody& body, const StressFields& fields, std::ptrdiff_t count);

/// Leaves the fields of the largest energy that stretch the body, at most kMaxStretchRows; none where it is not held. `error` becomes that
/// of what is left. fields: with values. Collective.
void keep_stretch(const CoupledBody& body, StressFields& fields);

}  // namespace carillon::coupling
