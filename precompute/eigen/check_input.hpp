// What the eigensolver asks of its caller.
#pragma once

#include "precompute/eigen/types.hpp"

namespace carillon::eigen {

/// Throws InputError on all ranks alike when a matrix is missing, an option is out of range, or the layout does not fit the matrices.
/// Collective.
void check_input(const Problem& problem, const Options& options);

}  // namespace carillon::eigen
