// Least squares with coefficients that are not negative.
#pragma once

#include <cstddef>
#include <vector>

#include "precompute/la/lapack.hpp"

namespace carillon::coupling {

/// x >= 0 with few entries that are not 0 so that |A x - b| is small: the method of Lawson and Hanson, stopped when |A x - b| <= tolerance
/// |b|, `most` entries are not 0, or no other improves it. Returns x. Not collective.
la::Vector solve_nonnegative(const la::Matrix& a, const la::Vector& b, double tolerance, std::ptrdiff_t most);

}  // namespace carillon::coupling
