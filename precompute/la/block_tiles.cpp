// Method: All loops over register values are unrolled: a rolled one would spill the others to memory.
#include "precompute/la/block_tiles.hpp"

#include <algorithm>
#include <cstdint>

#include "runtime/base/simd.hpp"

HWY_BEFORE_NAMESPACE();
namespace carillon::la::HWY_NAMESPACE {
namespace {

#if HWY_TARGET == HWY_SCALAR || HWY_TARGET == HWY_EMU128
constexpr BlockTiles kTiles;
#else
namespace hn = hwy::HWY_NAMESPACE;

constexpr hn::ScalableTag<double> kTag;
using V = hn::Vec<decltype(kTag)>;
constexpr int kLanes = HWY_MAX_BYTES / sizeof(double);
constexpr bool kHasFewRegisters = HWY_TARGET == HWY_AVX2 || HWY_TARGET == HWY_SSE4;  // sixteen, not thirty-two

/// A vector of a column of which `left` rows are left, a multiple of kLanes. Masked loads, though of all lanes, are up to 8 % faster on
/// Zen 5 where memory is the limit.
inline V load(const double* from, [[maybe_unused]] std::ptrdiff_t left) {
#if HWY_TARGET == HWY_AVX3
  const std::uint8_t bits[8] = {static_cast<std::uint8_t>(left >= kLanes ? 0xff : (1 << left) - 1)};
  return hn::MaskedLoad(hn::LoadMaskBits(kTag, bits), kTag, from);
#else
  return hn::LoadU(kTag, from);
#endif
}

inline void prefetch_rows(const Prefetch& next, std::ptrdiff_t lda, std::ptrdiff_t row) {
  for (int i = 0; i < next.columns; ++i) {
    __builtin_prefetch(next.near + i * lda + row);
    __builtin_prefetch(next.far + i * lda + row, 0, 2);
  }
}

template <int kCount>
void add_transposed(const double* a, std::ptrdiff_t lda, const double* b, std::ptrdiff_t ldb, std::ptrdiff_t rows, double* sums,
                    Prefetch next) {
  V sum[kCount][kTile];
#pragma GCC unroll 6
  for (int i = 0; i < kCount; ++i)
#pragma GCC unroll 4
    for (int j = 0; j < kTile; ++j) sum[i][j] = hn::Load(kTag, sums + kSums * (i * kTile + j));
  for (std::ptrdiff_t r = 0; r < rows; r += kLanes) {
    V own[kTile];
#pragma GCC unroll 4
    for (int j = 0; j < kTile; ++j) own[j] = hn::Load(kTag, b + j * ldb + r);
    if (kLanes == kSums || r % kSums == 0) prefetch_rows(next, lda, r);
#pragma GCC unroll 6
    for (int i = 0; i < kCount; ++i) {
      const V x = load(a + i * lda + r, rows - r);
#pragma GCC unroll 4
      for (int j = 0; j < kTile; ++j) sum[i][j] = hn::MulAdd(x, own[j], sum[i][j]);
    }
  }
#pragma GCC unroll 6
  for (int i = 0; i < kCount; ++i)
#pragma GCC unroll 4
    for (int j = 0; j < kTile; ++j) hn::Store(sum[i][j], kTag, sums + kSums * (i * kTile + j));
}

void collect(const double* sums, int wide, int columns, double* small, std::ptrdiff_t stride) {
  constexpr hn::CappedTag<double, 4> kPart;
  constexpr int kStep = kLanes < 4 ? kLanes : 4;
  for (int j = 0; j < columns; ++j)
    for (int i = 0; i < wide; ++i) {
      const double* sum = sums + kSums * (i * kTile + j);
      auto total = hn::Load(kPart, sum);
      for (int k = kStep; k < kLanes; k += kStep) total = hn::Add(total, hn::Load(kPart, sum + k));
      small[j * stride + i] += hn::GetLane(hn::SumOfLanes(kPart, total));
    }
}

template <int kCount>
void subtract(const double* a, std::ptrdiff_t lda, const double* s, std::ptrdiff_t lds, double* b, std::ptrdiff_t ldb, std::ptrdiff_t rows,
              Prefetch next) {
  V by[kCount][kTile];
#pragma GCC unroll 6
  for (int i = 0; i < kCount; ++i)
#pragma GCC unroll 4
    for (int j = 0; j < kTile; ++j) by[i][j] = hn::Set(kTag, s[j * lds + i]);
  for (std::ptrdiff_t r = 0; r < rows; r += kLanes) {
    V own[kTile];
#pragma GCC unroll 4
    for (int j = 0; j < kTile; ++j) own[j] = hn::Load(kTag, b + j * ldb + r);
    if (kLanes == kSums || r % kSums == 0) prefetch_rows(next, lda, r);
#pragma GCC unroll 6
    for (int i = 0; i < kCount; ++i) {
      const V x = load(a + i * lda + r, rows - r);
#pragma GCC unroll 4
      for (int j = 0; j < kTile; ++j) own[j] = hn::NegMulAdd(x, by[i][j], own[j]);
    }
#pragma GCC unroll 4
    for (int j = 0; j < kTile; ++j) hn::Store(own[j], kTag, b + j * ldb + r);
  }
}

constexpr int kVectors = 3;  // vectors of rows and
constexpr int kColumns = 8;  // columns of A S in registers
constexpr int kRows = kVectors * kLanes;

void combine(const double* a, const double* s, int count, double* c, std::ptrdiff_t ldc, int rows, int columns) {
  V sum[kVectors][kColumns];
#pragma GCC unroll 3
  for (int i = 0; i < kVectors; ++i)
#pragma GCC unroll 8
    for (int j = 0; j < kColumns; ++j) sum[i][j] = hn::Zero(kTag);
  for (int k = 0; k < count; ++k) {
    V x[kVectors];
#pragma GCC unroll 3
    for (int i = 0; i < kVectors; ++i) x[i] = hn::LoadU(kTag, a + k * kRows + i * kLanes);
#pragma GCC unroll 8
    for (int j = 0; j < kColumns; ++j) {
      const V by = hn::Set(kTag, s[k * kColumns + j]);
#pragma GCC unroll 3
      for (int i = 0; i < kVectors; ++i) sum[i][j] = hn::MulAdd(x[i], by, sum[i][j]);
    }
  }
  double edge[kColumns][kRows];
  const bool is_whole = rows == kRows;
#pragma GCC unroll 8
  for (int j = 0; j < kColumns; ++j) {
    if (j == columns) break;
    double* to = is_whole ? c + j * ldc : edge[j];
#pragma GCC unroll 3
    for (int i = 0; i < kVectors; ++i) hn::StoreU(sum[i][j], kTag, to + i * kLanes);
  }
  if (is_whole) return;
  for (int j = 0; j < columns; ++j) std::copy_n(edge[j], rows, c + j * ldc);
}

constexpr BlockTiles kTiles{
    kHasFewRegisters ? 16 : kMostNarrow,
    kHasFewRegisters ? 3 : kMostWide,
    {nullptr, add_transposed<1>, add_transposed<2>, add_transposed<3>, add_transposed<4>, add_transposed<5>, add_transposed<6>},
    collect,
    {nullptr, subtract<1>, subtract<2>, subtract<3>, subtract<4>, subtract<5>, subtract<6>},
    kRows,
    kColumns,
    kHasFewRegisters ? nullptr : combine};
#endif

const BlockTiles& get_tiles() { return kTiles; }

}  // namespace
}  // namespace carillon::la::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace carillon::la {

HWY_EXPORT(get_tiles);

const BlockTiles& find_block_tiles() { return base::choose(HWY_DISPATCH_TABLE(get_tiles))(); }

}  // namespace carillon::la
#endif
