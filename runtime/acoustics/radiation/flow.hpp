// Inner loops of calc_gains, selected by instruction set at run time.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "runtime/base/instructions.hpp"

namespace carillon::radiation {

inline constexpr std::size_t kFlowBlock = 64;    // triangles per block
inline constexpr std::size_t kFlowColumns = 96;  // columns for all harmonics, whole vectors of every instruction set
inline constexpr std::size_t kFlowRows = 12;     // numbers of modes are multiples of this

/// A triangle: shape rows of its corners (modes, 3), and the flow through it per shape step along each axis.
struct Corners {
  std::array<const std::int16_t*, 3> steps{};
  std::array<float, 3> share{};
  float per_share = 0.0F;  // factor of squared flows in `squares`
};

struct FlowLoops {
  /// flow[m][i] += sum over t of through[t][m] harmonic[t][i] for a block of triangles. `through`: (kFlowBlock, rows), `harmonic`:
  /// (kFlowBlock, kFlowColumns), `flow`: (rows, kFlowColumns), row-major. Sums within a block are in single precision.
  void (*add_flow)(const float* through, const float* harmonic, std::size_t rows, double* flow);
  /// Flow of every mode through a triangle, (modes); adds its square times per_share to `squares`, (modes).
  void (*calc_through)(const Corners& corners, std::size_t modes, float* through, float* squares);
};

/// Loops of the best supported instruction set up to `best`.
const FlowLoops& find_flow_loops(base::Instructions best = base::Instructions::kBest);

}  // namespace carillon::radiation
