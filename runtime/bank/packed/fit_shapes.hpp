// Encoder of shapes for read_shapes().
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "runtime/bank/packed/rows.hpp"
#include "runtime/bank/packed/shapes.hpp"
#include "runtime/bank/packed/surface.hpp"

namespace carillon::packed {

/// Numbers for write_shapes() with which read_shapes() reproduces the wanted rows, in surface order and in steps of each mode, to about
/// 2^(-fineness / 2) steps, fineness (V) per vertex; and the decoded shapes. `factor`: calc_factors().
///
/// Method: three predictions per vertex, kriging alone and with coefficients of either kind (Fit); the one with the lowest rate-distortion
///   cost (Lagrange multiplier, bits of a geometric distribution) is chosen. Coefficients: regularised least squares over all modes,
///   rounded in turn, each compensating those before (Babai's nearest plane 1986). Finer levels, which predict fewer vertices, are
///   quantised more coarsely.
struct FittedShapes {
  std::vector<LevelNumbers> levels;
  std::vector<std::int16_t> shape;  // (V, m, 3)
};
/// Fills the wanted row (3, padded) of a vertex; the padding is and stays 0.
using GetRow = std::function<void(std::size_t vertex, std::span<float> row)>;
FittedShapes fit_shapes(const Surface& surface, std::size_t modes, std::span<const std::uint8_t> fineness, std::span<const float> factor,
                        const GetRow& get_wanted);

}  // namespace carillon::packed
