// What is to be said of shapes so that read_shapes() finds them again.
#pragma once

#include <vector>

#include "runtime/codec/rows.hpp"
#include "runtime/codec/shapes.hpp"
#include "runtime/codec/surface.hpp"

namespace carillon::codec {

/// Numbers for write_shapes(), with which read_shapes() gives `wanted` (V), in the order of the surface and in steps of each mode, back to
/// about a step in the mean; and what it gives, (V). `modes` of the rows count.
///
/// Method: of each vertex three predictions are tried, kriging alone and with coefficients of either kind (Fit), and the one is taken whose
///   numbers take the fewest bits for the error that stays (Lagrange's multiplier, with costs in bits of a geometric law). Coefficients are
///   the least-squares solution over all modes with a prior of their own size, rounded one after the other, each for what the others leave
///   (Babai's nearest plane 1986). Finer levels, from which less is predicted, are quantised more coarsely.
struct FittedShapes {
  std::vector<LevelNumbers> levels;
  Rows rows;
};
FittedShapes fit_shapes(const Surface& surface, const Rows& wanted, std::size_t modes);

}  // namespace carillon::codec
