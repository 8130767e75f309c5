// Input checks of the eigensolver.
#pragma once

#include "precompute/eigen/types.hpp"

namespace carillon::eigen {

/// Throws InputError on all ranks if a matrix is missing, an option is out of range, or the layout does not fit the matrices. Collective.
void check_input(const Problem& problem, const Options& options);

}  // namespace carillon::eigen
