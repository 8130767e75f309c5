// The inner loops of shapes, once for each instruction set.
#pragma once

#include <cstddef>
#include <cstdint>

#include "runtime/bank/packed/stencil.hpp"

namespace carillon::packed {

/// Places among which the nearest are looked for, kNeighbours to kMost; coordinates apart, as vectors take them.
struct Near {
  static constexpr std::size_t kMost = 128;
  std::size_t count = 0;
  alignas(64) std::array<std::int32_t, kMost> x{}, y{}, z{}, vertex{};
};
inline constexpr int kReachBits = 12;  // three squares of as many bits, sign included, and the number of a place fit 31 bits

struct Loops {
  /// calc_stencils() of `count` vertices.
  void (*calc_stencils)(const Place* centres, const Neighbours* neighbours, const Place* places, std::size_t count, Stencil* stencils);
  /// The kNeighbours of `near` nearest to a place that is within 2^(reach - 1) of each along every axis, the nearest first; of places
  /// equally near, to within 2^(reach - kReachBits), the first.
  void (*find_nearest)(const Near& near, const Place& place, int reach, Neighbours& found);
  /// The matrix of a prediction with fitted coefficients: gradient (27), differences (9 kNeighbours, or null).
  void (*calc_matrix)(const Stencil& stencil, const float* gradient, const float* differences, Matrix& matrix);
  /// row = sum over k of weights[k] rows[k]; kNeighbours of them, `width` long.
  void (*add_weighted)(const float* const* rows, const float* weights, std::size_t width, float* row);
  /// row = matrix times rows, component by component: rows are (3, padded).
  void (*multiply)(const float* const* rows, const float* matrix, std::size_t padded, float* row);
  /// Sum of squares.
  float (*calc_energy)(const float* row, std::size_t width);
  /// shape[3 m + c] = row[c][m] factor[m], rounded to nearest and held within +-32767; `row` is (3, padded), `factor` (padded), `shape` has
  /// room for 3 padded.
  void (*round)(const float* row, const float* factor, std::size_t padded, std::int16_t* shape);
};

extern const Loops kLoopsPlain, kLoopsAvx2, kLoopsAvx512;

/// Those for this processor.
const Loops& find_loops();

}  // namespace carillon::packed
