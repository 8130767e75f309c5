// Inner loops of calc_gains, one per instruction set.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace carillon::radiation {

inline constexpr std::size_t kFlowBlock = 64;    // triangles per block
inline constexpr std::size_t kFlowColumns = 96;  // columns for all harmonics, whole vectors of every instruction set
inline constexpr std::size_t kFlowRows = 12;     // numbers of modes are multiples of this

/// flow[m][i] += sum over t of through[t][m] harmonic[t][i] for a block of triangles. `through`: (kFlowBlock, rows), `harmonic`:
/// (kFlowBlock, kFlowColumns), `flow`: (rows, kFlowColumns), row-major. Sums within a block are in single precision.
using AddFlow = void (*)(const float* through, const float* harmonic, std::size_t rows, double* flow);

void add_flow_plain(const float* through, const float* harmonic, std::size_t rows, double* flow);
void add_flow_avx2(const float* through, const float* harmonic, std::size_t rows, double* flow);
void add_flow_avx512(const float* through, const float* harmonic, std::size_t rows, double* flow);

/// A triangle: shape rows of its corners (modes, 3), and the flow through it per shape step along each axis.
struct Corners {
  std::array<const std::int16_t*, 3> steps{};
  std::array<float, 3> share{};
  float per_share = 0.0F;  // factor of squared flows in `squares`
};

/// Flow of every mode through a triangle, (modes); adds its square times per_share to `squares`, (modes).
using CalcThrough = void (*)(const Corners& corners, std::size_t modes, float* through, float* squares);

void calc_through_plain(const Corners& corners, std::size_t modes, float* through, float* squares);
void calc_through_avx2(const Corners& corners, std::size_t modes, float* through, float* squares);
void calc_through_avx512(const Corners& corners, std::size_t modes, float* through, float* squares);

}  // namespace carillon::radiation
