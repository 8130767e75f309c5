// The inner loops of calc_gains, once for each instruction set.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace carillon::radiation {

inline constexpr std::size_t kFlowBlock = 64;    // triangles at once
inline constexpr std::size_t kFlowColumns = 96;  // room for all harmonics, whole vectors of every kind
inline constexpr std::size_t kFlowRows = 12;     // modes come in multiples of this

/// Adds the flow of a block through every harmonic: flow[m][i] += sum over t of through[t][m] harmonic[t][i]. `through` is (kFlowBlock,
/// rows), `harmonic` (kFlowBlock, kFlowColumns) and `flow` (rows, kFlowColumns), row-major. Sums of a block are in single precision.
using AddFlow = void (*)(const float* through, const float* harmonic, std::size_t rows, double* flow);

void add_flow_plain(const float* through, const float* harmonic, std::size_t rows, double* flow);
void add_flow_avx2(const float* through, const float* harmonic, std::size_t rows, double* flow);
void add_flow_avx512(const float* through, const float* harmonic, std::size_t rows, double* flow);

/// A triangle: the rows of its corners in the shapes of the bank (modes, 3), and what a motion of one step along each axis sends through
/// it.
struct Corners {
  std::array<const std::int16_t*, 3> steps{};
  std::array<float, 3> share{};
  float per_share = 0.0F;  // of the square of a flow, in `squares`
};

/// The flow of every mode through a triangle, (modes), and its square times per_share added to `squares`, (modes).
using CalcThrough = void (*)(const Corners& corners, std::size_t modes, float* through, float* squares);

void calc_through_plain(const Corners& corners, std::size_t modes, float* through, float* squares);
void calc_through_avx2(const Corners& corners, std::size_t modes, float* through, float* squares);
void calc_through_avx512(const Corners& corners, std::size_t modes, float* through, float* squares);

}  // namespace carillon::radiation
