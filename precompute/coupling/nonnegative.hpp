// Nonnegative least squares.
#pragma once

#include <cstddef>

#include "precompute/la/lapack.hpp"

namespace carillon::coupling {

/// Sparse x >= 0 with small |A x - b|: Lawson and Hanson's method, stopped at |A x - b| <= tolerance |b|, at `most` nonzero entries, or
/// without further improvement. Not collective.
la::Vector solve_nonnegative(const la::Matrix& a, const la::Vector& b, double tolerance, std::ptrdiff_t most);

}  // namespace carillon::coupling
