// A convolution with its sums in registers: kVectors vectors of kLanes samples for each of kFilters filters, and two sums of each, over
// even and odd taps, so that enough sums are under way at once. Nothing of the standard library's templates is called here: the linker
// would take one copy of them for all files, maybe one with instructions that the processor has not.
#include "runtime/acoustics/head/convolve.hpp"

namespace carillon::head {
namespace {

template <int kLanes, int kVectors, int kFilters>
void sum_taps(const float* const* h, int taps, const float* x, float* const* out) noexcept {
  typedef float Vector __attribute__((vector_size(4 * kLanes)));
  constexpr int kParts = 2;
  static_assert(kChunk % (kLanes * kVectors) == 0 && kTapUnit % kParts == 0);
  for (int first = 0; first < kChunk; first += kLanes * kVectors) {
    Vector sum[kParts][kFilters][kVectors] = {};
    for (int k = 0; k < taps; k += kParts) {
#pragma GCC unroll 2
      for (int part = 0; part < kParts; ++part) {
        Vector sample[kVectors];
#pragma GCC unroll 8
        for (int v = 0; v < kVectors; ++v) __builtin_memcpy(&sample[v], x + first + v * kLanes - k - part, sizeof(Vector));
#pragma GCC unroll 2
        for (int f = 0; f < kFilters; ++f) {
#pragma GCC unroll 8
          for (int v = 0; v < kVectors; ++v) sum[part][f][v] += h[f][k + part] * sample[v];
        }
      }
    }
#pragma GCC unroll 2
    for (int f = 0; f < kFilters; ++f) {
#pragma GCC unroll 8
      for (int v = 0; v < kVectors; ++v) {
        const Vector total = sum[0][f][v] + sum[1][f][v];
        __builtin_memcpy(out[f] + first + v * kLanes, &total, sizeof(Vector));
      }
    }
  }
}

template <int kLanes, int kVectors>
void convolve(const float* h, int taps, const float* x, float* out) noexcept {
  sum_taps<kLanes, kVectors, 1>(&h, taps, x, &out);
}

template <int kLanes, int kVectors>
void convolve_pair(const float* h_a, const float* h_b, int taps, const float* x, float* out_a, float* out_b) noexcept {
  const float* const h[2] = {h_a, h_b};
  float* const out[2] = {out_a, out_b};
  sum_taps<kLanes, kVectors, 2>(h, taps, x, out);
}

void blend(const float* const* rows, const float* weight, int taps, float* __restrict out) noexcept {
  const float* const a = rows[0];
  const float* const b = rows[1];
  const float* const c = rows[2];
  const float p = weight[0], q = weight[1], r = weight[2];
  for (int k = 0; k < taps; ++k) out[k] = p * a[k] + q * b[k] + r * c[k];
}

}  // namespace
}  // namespace carillon::head
