// The inner loops of shapes, once for each instruction set.
#pragma once

#include <cstddef>
#include <cstdint>

#include "runtime/codec/stencil.hpp"

namespace carillon::codec {

struct Loops {
  /// calc_stencils() of `count` vertices.
  void (*calc_stencils)(const Place* centres, const Neighbours* neighbours, const Place* places, std::size_t count, Stencil* stencils);
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

}  // namespace carillon::codec
