// A block of a matrix product with its sums in registers: kRows modes times kVectors vectors of kLanes harmonics.
#include "runtime/radiation/flow.hpp"

namespace carillon::radiation {
namespace {

template <int kLanes, int kVectors, int kRows>
void add_flow(const float* through, const float* harmonic, std::size_t rows, double* flow) {
  typedef float Vector __attribute__((vector_size(4 * kLanes)));
  static_assert(kFlowColumns % (kLanes * kVectors) == 0 && kFlowRows % kRows == 0);
  for (std::size_t m = 0; m < rows; m += kRows) {
    for (std::size_t i = 0; i < kFlowColumns; i += kLanes * kVectors) {
      Vector sum[kRows][kVectors] = {};
      for (std::size_t t = 0; t < kFlowBlock; ++t) {
        Vector wave[kVectors];
        __builtin_memcpy(wave, harmonic + t * kFlowColumns + i, sizeof wave);
        const float* row = through + t * rows + m;
        for (int r = 0; r < kRows; ++r)
          for (int v = 0; v < kVectors; ++v) sum[r][v] += row[r] * wave[v];
      }
      for (int r = 0; r < kRows; ++r)
        for (int v = 0; v < kVectors; ++v)
          for (int k = 0; k < kLanes; ++k)
            flow[(m + static_cast<std::size_t>(r)) * kFlowColumns + i + static_cast<std::size_t>(v * kLanes + k)] +=
                static_cast<double>(sum[r][v][k]);
    }
  }
}

}  // namespace
}  // namespace carillon::radiation
