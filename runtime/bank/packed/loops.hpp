// Inner loops of shapes, selected by instruction set at run time.
#pragma once

#include <cstddef>
#include <cstdint>

#include "runtime/bank/packed/stencil.hpp"
#include "runtime/base/instructions.hpp"

namespace carillon::packed {

/// Candidates of a nearest-neighbour search, kNeighbours to kMost; structure of arrays.
struct Near {
  static constexpr std::size_t kMost = 128;
  std::size_t count = 0;
  alignas(64) std::array<std::int32_t, kMost> x{}, y{}, z{}, vertex{};
};
inline constexpr int kReachBits = 12;  // three squares of this many bits (sign included) and a candidate index fit 31 bits

struct Loops {
  /// calc_stencils() for `count` vertices.
  void (*calc_stencils)(const Place* centres, const Neighbours* neighbours, const Place* places, std::size_t count, Stencil* stencils);
  /// The kNeighbours of `near` closest to a place within 2^(reach - 1) of each candidate along every axis, ascending by distance; ties, to
  /// within 2^(reach - kReachBits), by candidate order.
  void (*find_nearest)(const Near& near, const Place& place, int reach, Neighbours& found);
  /// Prediction matrix with fitted coefficients: gradient (27), differences (9 kNeighbours, or null).
  void (*calc_matrix)(const Stencil& stencil, const float* gradient, const float* differences, Matrix& matrix);
  /// row = sum over k < kNeighbours of weights[k] rows[k], `width` long.
  void (*add_weighted)(const float* const* rows, const float* weights, std::size_t width, float* row);
  /// row = matrix times rows, component-wise: rows are (3, padded).
  void (*multiply)(const float* const* rows, const float* matrix, std::size_t padded, float* row);
  /// Sum of squares.
  float (*calc_energy)(const float* row, std::size_t width);
  /// shape[3 m + c] = row[c][m] factor[m], rounded to nearest and clamped to +-32767; `row`: (3, padded), `factor`: (padded), `shape`: room
  /// for 3 padded.
  void (*round)(const float* row, const float* factor, std::size_t padded, std::int16_t* shape);
};

/// Loops of the best supported instruction set up to `best`.
const Loops& find_loops(base::Instructions best = base::Instructions::kBest);

}  // namespace carillon::packed
