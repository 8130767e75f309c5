#include "runtime/acoustics/radiation/flow.hpp"

#include "runtime/base/simd.hpp"

HWY_BEFORE_NAMESPACE();
namespace carillon::radiation::HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
const hn::ScalableTag<float> kFloats;
constexpr std::size_t kLanes = hn::MaxLanes(kFloats);

/// A block of a matrix product with its sums in registers: kRows modes times kVectors vectors of harmonics.
void add_flow(const float* through, const float* harmonic, std::size_t rows, double* flow) {
  constexpr std::size_t kVectors = kLanes >= 8 ? 6 : 4, kRows = kLanes == 16 ? 4 : kLanes == 8 ? 2 : 3;
  static_assert(kFlowColumns % (kLanes * kVectors) == 0 && kFlowRows % kRows == 0);
  for (std::size_t m = 0; m < rows; m += kRows) {
    for (std::size_t i = 0; i < kFlowColumns; i += kLanes * kVectors) {
      // Unrolled, so that all sums are registers: g++ keeps an array in memory whose index it does not know.
      hn::Vec<decltype(kFloats)> sum[kRows][kVectors];
#pragma GCC unroll 8
      for (auto& row : sum) {
#pragma GCC unroll 8
        for (auto& one : row) one = hn::Zero(kFloats);
      }
      for (std::size_t t = 0; t < kFlowBlock; ++t) {
        const float* row = through + t * rows + m;
#pragma GCC unroll 8
        for (std::size_t v = 0; v < kVectors; ++v) {
          const auto wave = hn::LoadU(kFloats, harmonic + t * kFlowColumns + i + v * kLanes);
#pragma GCC unroll 8
          for (std::size_t r = 0; r < kRows; ++r) sum[r][v] = hn::MulAdd(hn::Set(kFloats, row[r]), wave, sum[r][v]);
        }
      }
      alignas(64) float block[kRows][kVectors * kLanes];
#pragma GCC unroll 8
      for (std::size_t r = 0; r < kRows; ++r) {
#pragma GCC unroll 8
        for (std::size_t v = 0; v < kVectors; ++v) hn::StoreU(sum[r][v], kFloats, block[r] + v * kLanes);
        double* const to = flow + (m + r) * kFlowColumns + i;
        for (std::size_t c = 0; c < kVectors * kLanes; ++c) to[c] += static_cast<double>(block[r][c]);
      }
    }
  }
}

/// Without contraction, so that all instruction sets give the same numbers.
void calc_through(const Corners& corners, std::size_t modes, float* through, float* squares) {
  const hn::Rebind<std::int16_t, decltype(kFloats)> shorts;
  const hn::Rebind<std::int32_t, decltype(kFloats)> ints;
  const auto [s0, s1, s2] = corners.share;
  std::size_t m = 0;
  for (; m + kLanes <= modes; m += kLanes) {
    alignas(64) float motion[3 * kLanes];
#pragma GCC unroll 3
    for (std::size_t i = 0; i < 3 * kLanes; i += kLanes) {
      const auto load = [&](const std::int16_t* steps) HWY_ATTR { return hn::PromoteTo(ints, hn::LoadU(shorts, steps + 3 * m + i)); };
      hn::Store(hn::ConvertTo(kFloats, load(corners.steps[0]) + load(corners.steps[1]) + load(corners.steps[2])), kFloats, motion + i);
    }
    auto x = hn::Undefined(kFloats), y = x, z = x;
    hn::LoadInterleaved3(kFloats, motion, x, y, z);
    const auto flow = hn::Set(kFloats, s0) * x + hn::Set(kFloats, s1) * y + hn::Set(kFloats, s2) * z;
    hn::StoreU(flow, kFloats, through + m);
    hn::StoreU(hn::LoadU(kFloats, squares + m) + flow * flow * hn::Set(kFloats, corners.per_share), kFloats, squares + m);
  }
  for (; m < modes; ++m) {
    float motion[3];
    for (std::size_t i = 0; i < 3; ++i)
      motion[i] = static_cast<float>(corners.steps[0][3 * m + i] + corners.steps[1][3 * m + i] + corners.steps[2][3 * m + i]);
    through[m] = s0 * motion[0] + s1 * motion[1] + s2 * motion[2];
    squares[m] += through[m] * through[m] * corners.per_share;
  }
}

const FlowLoops& get_table() {
  static constexpr FlowLoops kLoops{add_flow, calc_through};
  return kLoops;
}

}  // namespace
}  // namespace carillon::radiation::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace carillon::radiation {

HWY_EXPORT(get_table);
const FlowLoops& find_flow_loops(base::Instructions best) { return base::choose(HWY_DISPATCH_TABLE(get_table), best)(); }

}  // namespace carillon::radiation
#endif
