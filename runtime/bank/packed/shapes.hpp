// The shapes of all modes on a packed surface.
#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "runtime/bank/packed/stencil.hpp"
#include "runtime/bank/packed/surface.hpp"

namespace carillon::packed {

/// What is said of a vertex, one byte: bits 0 and 1 the Fit, bit 2 whether a residual follows, bits 3 to 7 the fineness.
struct Kind {
  Fit fit = Fit::kNone;
  bool has_residual = false;
  std::uint8_t fineness = 0;  // its steps are those of the level times 2^(-fineness / 2)
};
inline constexpr int kMaxFineness = 31;
constexpr std::uint8_t to_byte(Kind kind) {
  return static_cast<std::uint8_t>(static_cast<int>(kind.fit) | (kind.has_residual ? 4 : 0) | (kind.fineness << 3));
}
/// Of a byte whose lowest two bits are not both set.
constexpr Kind to_kind(std::uint8_t byte) { return {static_cast<Fit>(byte & 3), (byte & 4) != 0, static_cast<std::uint8_t>(byte >> 3)}; }

/// The steps of a level. Numbers of a vertex are integers times these: of the residual in steps of each mode, of the coefficients over the
/// root of 1 + the mean energy of the neighbours (sum of squares of a row, in steps of the modes).
struct LevelSteps {
  float residual = 1.0F;
  float gradient = 1.0F;
  float differences = 1.0F;
  std::uint8_t cell_shift = 0;  // of the search for neighbours

  static float calc_share(int fineness) { return std::exp2(-0.5F * static_cast<float>(fineness)); }
};

/// What the bytes of the shapes of a level say, vertex by vertex.
struct LevelNumbers {
  LevelSteps steps;
  std::vector<Kind> kinds;                // (V of the level)
  std::vector<std::int32_t> gradient;     // (vertices of a fit, 27)
  std::vector<std::int32_t> differences;  // (vertices of Fit::kDifferences, 90)
  std::vector<std::int32_t> residual;     // (vertices of a residual, m, 3)
};

/// The bytes that read_shapes() takes. step (m): the quantisation step of each mode [kg^-1/2]; levels (L).
std::vector<std::uint8_t> write_shapes(std::span<const float> step, std::span<const LevelNumbers> levels);

/// The shapes (V, m, 3) in steps of `scale` (m) [kg^-1/2], from bytes that write_shapes() made for this surface and as many modes; modes of
/// scale 0 are at rest. Untrusted as read_surface().
///
/// Method: level by level, each vertex is predicted from its kNeighbours nearest of the levels before by its stencil and fitted
///   coefficients; what remains is coded in steps of the mode. The coarsest level is its residual.
std::vector<std::int16_t> read_shapes(std::span<const std::byte> bytes, const Surface& surface, std::span<const double> scale,
                                      const std::string& name);

}  // namespace carillon::packed
