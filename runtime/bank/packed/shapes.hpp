// Shapes of all modes on a packed surface.
#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "runtime/bank/packed/stencil.hpp"
#include "runtime/bank/packed/surface.hpp"

namespace carillon::packed {

/// Header byte of a vertex: bits 0 and 1 the Fit, bit 2 a residual follows, bits 3 to 7 the fineness.
struct Kind {
  Fit fit = Fit::kNone;
  bool has_residual = false;
  std::uint8_t fineness = 0;  // steps: those of the level times 2^(-fineness / 2)
};
inline constexpr int kMaxFineness = 31;
constexpr std::uint8_t to_byte(Kind kind) {
  return static_cast<std::uint8_t>(static_cast<int>(kind.fit) | (kind.has_residual ? 4 : 0) | (kind.fineness << 3));
}
/// Requires that the lowest two bits are not both set.
constexpr Kind to_kind(std::uint8_t byte) { return {static_cast<Fit>(byte & 3), (byte & 4) != 0, static_cast<std::uint8_t>(byte >> 3)}; }

/// Quantisation steps of a level. Numbers of a vertex are integer multiples: of the residual, in steps of each mode; of the coefficients,
/// divided by the root of 1 + mean energy of the neighbours (sum of squares of a row, in steps of the modes).
struct LevelSteps {
  float residual = 1.0F;
  float gradient = 1.0F;
  float differences = 1.0F;
  std::uint8_t cell_shift = 0;  // cell width of the neighbour search

  static float calc_share(int fineness) { return std::exp2(-0.5F * static_cast<float>(fineness)); }
};

/// Encoded numbers of a level, vertex by vertex.
struct LevelNumbers {
  LevelSteps steps;
  std::vector<Kind> kinds;                // (vertices of the level)
  std::vector<std::int32_t> gradient;     // (vertices with a fit, 27)
  std::vector<std::int32_t> differences;  // (vertices with Fit::kDifferences, 90)
  std::vector<std::int32_t> residual;     // (vertices with a residual, m, 3)
};

/// Bytes for read_shapes(). step (m): quantisation step of each mode [kg^-1/2]; levels (L).
std::vector<std::uint8_t> write_shapes(std::span<const float> step, std::span<const LevelNumbers> levels);

/// Steps of the decoded shape per step of each mode, padded for Rows: step / scale, 0 for modes at rest.
std::vector<float> calc_factors(std::span<const float> step, std::span<const double> scale);

/// Shapes (V, m, 3) in steps of `scale` (m) [kg^-1/2] from the bytes of write_shapes() for this surface and as many modes; modes of scale 0
/// are at rest. Untrusted bytes as in read_surface().
///
/// Method: level by level, each vertex is predicted from its kNeighbours nearest of the coarser levels by its stencil and fitted
///   coefficients; the remainder is coded in steps of the mode. The coarsest level is coded as residual only.
std::vector<std::int16_t> read_shapes(std::span<const std::byte> bytes, const Surface& surface, std::span<const double> scale,
                                      const std::string& name);

}  // namespace carillon::packed
