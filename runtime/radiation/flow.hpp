// The inner loop of calc_gains, once for each instruction set.
#pragma once

#include <cstddef>

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

}  // namespace carillon::radiation
