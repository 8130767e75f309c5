// A block of a matrix product with its sums in registers: kRows modes times kVectors vectors of kLanes harmonics.
#include "runtime/acoustics/radiation/flow.hpp"

namespace carillon::radiation {
namespace {

template <int kLanes, int kVectors, int kRows>
void add_flow(const float* through, const float* harmonic, std::size_t rows, double* flow) {
  typedef float Vector __attribute__((vector_size(4 * kLanes)));
  typedef double Sums __attribute__((vector_size(8 * kLanes)));
  static_assert(kFlowColumns % (kLanes * kVectors) == 0 && kFlowRows % kRows == 0);
  const auto load = [](const auto* from, auto& vector) { __builtin_memcpy(&vector, from, sizeof vector); };
  for (std::size_t m = 0; m < rows; m += kRows) {
    for (std::size_t i = 0; i < kFlowColumns; i += kLanes * kVectors) {
      // Unrolled, so that all sums are registers: g++ keeps an array in memory whose index it does not know.
      Vector sum[kRows][kVectors] = {};
      for (std::size_t t = 0; t < kFlowBlock; ++t) {
        Vector wave[kVectors];
#pragma GCC unroll 8
        for (int v = 0; v < kVectors; ++v) load(harmonic + t * kFlowColumns + i + v * kLanes, wave[v]);
        const float* row = through + t * rows + m;
#pragma GCC unroll 8
        for (int r = 0; r < kRows; ++r) {
#pragma GCC unroll 8
          for (int v = 0; v < kVectors; ++v) sum[r][v] += row[r] * wave[v];
        }
      }
#pragma GCC unroll 8
      for (int r = 0; r < kRows; ++r) {
#pragma GCC unroll 8
        for (int v = 0; v < kVectors; ++v) {
          double* const to = flow + (m + static_cast<std::size_t>(r)) * kFlowColumns + i + static_cast<std::size_t>(v * kLanes);
          Sums sums;
          load(to, sums);
          sums += __builtin_convertvector(sum[r][v], Sums);
          __builtin_memcpy(to, &sums, sizeof sums);
        }
      }
    }
  }
}

}  // namespace
}  // namespace carillon::radiation
