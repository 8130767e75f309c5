// Mean stretch of a body with held edges: few fields instead of all.
#pragma once

#include "precompute/coupling/stresses.hpp"

namespace carillon::coupling {

inline constexpr std::ptrdiff_t kMaxStretchRows = 3;  // of a sheet: two directions and shear
/// Fraction of a field's energy in its mean over the body from which it counts as stretch. Bodies without opposite held edges have zero
/// mean: a mean needs surface forces.
inline constexpr double kMeanShare = 0.2;

/// (count) of the first fields: fraction of the energy in the mean over the body, 0 to 1. fields: with values. Collective.
la::Vector calc_mean_shares(const CoupledBody& body, const StressFields& fields, std::ptrdiff_t count);

/// Keeps the fields of the largest energy that stretch the body, at most kMaxStretchRows; none if it is not held. `error` becomes that of
/// the rest. fields: with values. Collective.
void keep_stretch(const CoupledBody& body, StressFields& fields);

}  // namespace carillon::coupling
