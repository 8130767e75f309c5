#include "runtime/acoustics/head/convolve.hpp"

#include "runtime/base/simd.hpp"

HWY_BEFORE_NAMESPACE();
namespace carillon::head::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
const hn::ScalableTag<float> kFloats;
constexpr int kLanes = static_cast<int>(hn::MaxLanes(kFloats));

/// A convolution with its sums in registers: kVectors vectors of samples for each of kFilters filters, and two sums of each, over even and
/// odd taps, so that enough sums are under way at once.
template <int kVectors, int kFilters>
void sum_taps(const float* const* h, int taps, const float* x, float* const* out) noexcept {
  constexpr int kParts = 2;
  static_assert(kChunk % (kLanes * kVectors) == 0 && kTapUnit % kParts == 0);
  for (int first = 0; first < kChunk; first += kLanes * kVectors) {
    hn::Vec<decltype(kFloats)> sum[kParts][kFilters][kVectors];
#pragma GCC unroll 2
    for (auto& part : sum) {
#pragma GCC unroll 2
      for (auto& filter : part) {
#pragma GCC unroll 8
        for (auto& one : filter) one = hn::Zero(kFloats);
      }
    }
    for (int k = 0; k < taps; k += kParts) {
#pragma GCC unroll 2
      for (int part = 0; part < kParts; ++part) {
        hn::Vec<decltype(kFloats)> sample[kVectors];
#pragma GCC unroll 8
        for (int v = 0; v < kVectors; ++v) sample[v] = hn::LoadU(kFloats, x + first + v * kLanes - k - part);
#pragma GCC unroll 2
        for (int f = 0; f < kFilters; ++f) {
          const auto tap = hn::Set(kFloats, h[f][k + part]);
#pragma GCC unroll 8
          for (int v = 0; v < kVectors; ++v) sum[part][f][v] = hn::MulAdd(tap, sample[v], sum[part][f][v]);
        }
      }
    }
#pragma GCC unroll 2
    for (int f = 0; f < kFilters; ++f) {
#pragma GCC unroll 8
      for (int v = 0; v < kVectors; ++v) hn::StoreU(sum[0][f][v] + sum[1][f][v], kFloats, out[f] + first + v * kLanes);
    }
  }
}

void convolve(const float* h, int taps, const float* x, float* out) noexcept { sum_taps<kLanes == 16 ? 2 : 4, 1>(&h, taps, x, &out); }

void convolve_pair(const float* h_a, const float* h_b, int taps, const float* x, float* out_a, float* out_b) noexcept {
  const float* const h[2] = {h_a, h_b};
  float* const out[2] = {out_a, out_b};
  sum_taps<2, 2>(h, taps, x, out);
}

void blend(const float* const* rows, const float* weight, int taps, float* out) noexcept {
  const float *const a = rows[0], *const b = rows[1], *const c = rows[2];
  const auto p = hn::Set(kFloats, weight[0]), q = hn::Set(kFloats, weight[1]), r = hn::Set(kFloats, weight[2]);
  static_assert(kTapUnit % kLanes == 0);
  for (int k = 0; k < taps; k += kLanes) {
    const auto sum = hn::MulAdd(p, hn::LoadU(kFloats, a + k), q * hn::LoadU(kFloats, b + k));
    hn::StoreU(hn::MulAdd(r, hn::LoadU(kFloats, c + k), sum), kFloats, out + k);
  }
}

const Loops& get_table() {
  static constexpr Loops kLoops{convolve, convolve_pair, blend};
  return kLoops;
}

}  // namespace
}  // namespace carillon::head::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace carillon::head {

HWY_EXPORT(get_table);
const Loops& get_loops(base::Instructions best) noexcept { return base::choose(HWY_DISPATCH_TABLE(get_table), best)(); }

}  // namespace carillon::head
#endif
