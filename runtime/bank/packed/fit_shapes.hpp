// What is to be said of shapes so that read_shapes() finds them again.
#pragma once

#include <vector>

#include "runtime/bank/packed/rows.hpp"
#include "runtime/bank/packed/shapes.hpp"
#include "runtime/bank/packed/surface.hpp"

namespace carillon::packed {

/// Numbers for write_shapes(), with which read_shapes() gives `wanted` (V), in the order of the surface and in steps of each mode, back to
/// about 2^(-fineness / 2) steps, with the fineness (V) of each vertex; and what it gives, (V). `modes` of the rows count.
///
/// Method: of each vertex three predictions are tried, kriging alone and with coefficients of either kind (Fit), and the one is taken whose
///   numbers take the fewest bits for the error that stays (Lagrange's multiplier, with costs in bits of a geometric law). Coefficients are
///   the least-squares solution over all modes with a prior of their own size, rounded one after the other, each for what the others leave
///   (Babai's nearest plane 1986). Finer levels, from which less is predicted, are quantised more coarsely.
struct FittedShapes {
  std::vector<LevelNumbers> levels;
  Rows rows;
};
/// sampled: of the finest level only the vertices with numbers divisible by it are fitted, the others stay at rest; for trials.
FittedShapes fit_shapes(const Surface& surface, const Rows& wanted, std::size_t modes, std::span<const std::uint8_t> fineness,
                        std::size_t sampled = 1);

}  // namespace carillon::packed
