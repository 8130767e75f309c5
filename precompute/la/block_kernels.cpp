// Method: The narrow block is packed in panels of rows that stay in the second-level cache; the wide block is streamed, a few columns at a
// time, in strips that stay in the first-level cache and are prefetched one strip ahead. Sums and coefficients are in registers (6 x 4
// tiles). The wide block is not packed: it is used once, and packing halves the speed of BLAS for 16 columns
// (docs/decisions/block-lanczos.md). Processors without AVX-512 use BLAS on the same panels.
// Source: Goto, van de Geijn, Anatomy of high-performance matrix multiplication, ACM TOMS 34(3), 2008 (panels, register tiles).
#include "precompute/la/block_kernels.hpp"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <vector>

#include "precompute/petsc/work.hpp"
#include "runtime/base/instructions.hpp"

#if defined(__x86_64__)
#include <immintrin.h>
#endif

namespace carillon::la {
namespace {

constexpr std::ptrdiff_t kRowsTransposed = 4096;  // rows of a panel for A^T B: 16 columns of B are half a megabyte
constexpr std::ptrdiff_t kStripTransposed = 128;  // rows of a strip of it
constexpr std::ptrdiff_t kRowsProduct = 2048;     // rows of a panel for B - A S, which is also written
constexpr std::ptrdiff_t kStripProduct = 128;     // rows of a strip of it
constexpr std::ptrdiff_t kRowsFused = 2048;       // rows of a panel used by several products
constexpr std::ptrdiff_t kRowsCombined = 256;     // rows of a panel for A S
constexpr int kNarrow = 32;                       // maximum columns of the narrow block: dgemm is as fast for wider ones
constexpr int kTile = 4;                          // columns of the narrow block in registers
constexpr int kWide = 6;                          // columns of the wide block in registers

int round_up(int n, int to) { return (n + to - 1) / to * to; }

#if defined(__x86_64__)
#define CARILLON_AVX512 __attribute__((target("avx512f")))

bool has_avx512() { return base::has_instructions(base::Instructions::kAvx512); }

// All loops over register values are unrolled: a rolled one would spill the others to memory.

// Prefetches of a tile: columns of the wide block, one strip ahead to the first-level cache and a few strips ahead to the second. The first
// alone has too few open requests to saturate memory.
struct Prefetch {
  const double* near = nullptr;
  const double* far = nullptr;
  int columns = 0;
};

/// The strips of a panel in the order of use: down a group of columns, then the next group. Avoids divisions per tile.
class Strips {
 public:
  /// first, rows: of the panel; strip: rows of a strip; tiles: number of tiles per strip.
  Strips(const Columns& a, std::ptrdiff_t first, std::ptrdiff_t rows, std::ptrdiff_t strip, int tiles)
      : a_(a), first_(first), rows_(rows), strip_(strip), height_((rows + strip - 1) / strip * strip), tiles_(tiles) {}

  /// Starts columns [i, i + wide).
  void begin_columns(int i, int wide) {
    column_ = i;
    for (int j = 0; j <= tiles_; ++j) share_[j] = j * wide / tiles_;
  }
  /// Starts row r of the panel.
  void begin_strip(std::ptrdiff_t r) {
    constexpr int kFar = 3;
    near_ = find(r + strip_);
    far_ = find(r + kFar * strip_);
  }
  /// Prefetch share of tile j.
  Prefetch find_prefetch(int j) const {
    const std::ptrdiff_t offset = share_[j] * a_.stride;
    return {near_ + offset, far_ + offset, share_[j + 1] - share_[j]};
  }

 private:
  const double* find(std::ptrdiff_t r) const {
    int i = column_;
    for (; r >= height_; r -= height_) i += kWide;
    if (i < a_.count) return a_.column(i) + first_ + r;
    return a_.column(0) + std::min(first_ + rows_ + r, a_.rows - 1);  // of the next panel
  }

  const Columns& a_;
  std::ptrdiff_t first_;
  std::ptrdiff_t rows_;
  std::ptrdiff_t strip_;
  std::ptrdiff_t height_;
  int tiles_;
  int column_ = 0;
  int share_[kNarrow / kTile + 1] = {};
  const double* near_ = nullptr;
  const double* far_ = nullptr;
};

// sum (kCount x 4 vectors of lanes) += a^T b over `rows`, any number; b is packed: aligned, zero beyond the rows.
template <int kCount>
CARILLON_AVX512 void add_transposed_tile(const double* a, std::ptrdiff_t lda, const double* b, std::ptrdiff_t ldb, std::ptrdiff_t rows,
                                         double* lanes, Prefetch next) {
  __m512d sum[kCount][kTile];
#pragma GCC unroll 6
  for (int i = 0; i < kCount; ++i) {
#pragma GCC unroll 4
    for (int j = 0; j < kTile; ++j) sum[i][j] = _mm512_load_pd(lanes + 8 * (i * kTile + j));
  }
  for (std::ptrdiff_t r = 0; r < rows; r += 8) {
    const __mmask8 mask = r + 8 <= rows ? 0xff : static_cast<__mmask8>((1 << (rows - r)) - 1);
    const __m512d b0 = _mm512_load_pd(b + r), b1 = _mm512_load_pd(b + ldb + r);
    const __m512d b2 = _mm512_load_pd(b + 2 * ldb + r), b3 = _mm512_load_pd(b + 3 * ldb + r);
    for (int i = 0; i < next.columns; ++i) {
      _mm_prefetch(reinterpret_cast<const char*>(next.near + i * lda + r), _MM_HINT_T0);
      _mm_prefetch(reinterpret_cast<const char*>(next.far + i * lda + r), _MM_HINT_T1);
    }
#pragma GCC unroll 6
    for (int i = 0; i < kCount; ++i) {
      const __m512d x = _mm512_maskz_loadu_pd(mask, a + i * lda + r);
      sum[i][0] = _mm512_fmadd_pd(x, b0, sum[i][0]);
      sum[i][1] = _mm512_fmadd_pd(x, b1, sum[i][1]);
      sum[i][2] = _mm512_fmadd_pd(x, b2, sum[i][2]);
      sum[i][3] = _mm512_fmadd_pd(x, b3, sum[i][3]);
    }
  }
#pragma GCC unroll 6
  for (int i = 0; i < kCount; ++i) {
#pragma GCC unroll 4
    for (int j = 0; j < kTile; ++j) _mm512_store_pd(lanes + 8 * (i * kTile + j), sum[i][j]);
  }
}

// b (rows x 4, packed) -= a (rows x kCount) s (kCount x 4).
template <int kCount>
CARILLON_AVX512 void subtract_tile(const double* a, std::ptrdiff_t lda, const double* s, std::ptrdiff_t lds, double* b, std::ptrdiff_t ldb,
                                   std::ptrdiff_t rows, Prefetch next) {
  __m512d c[kCount][kTile];
#pragma GCC unroll 6
  for (int i = 0; i < kCount; ++i) {
#pragma GCC unroll 4
    for (int j = 0; j < kTile; ++j) c[i][j] = _mm512_set1_pd(s[j * lds + i]);
  }
  for (std::ptrdiff_t r = 0; r < rows; r += 8) {
    const __mmask8 mask = r + 8 <= rows ? 0xff : static_cast<__mmask8>((1 << (rows - r)) - 1);
    __m512d b0 = _mm512_load_pd(b + r), b1 = _mm512_load_pd(b + ldb + r);
    __m512d b2 = _mm512_load_pd(b + 2 * ldb + r), b3 = _mm512_load_pd(b + 3 * ldb + r);
    for (int i = 0; i < next.columns; ++i) {
      _mm_prefetch(reinterpret_cast<const char*>(next.near + i * lda + r), _MM_HINT_T0);
      _mm_prefetch(reinterpret_cast<const char*>(next.far + i * lda + r), _MM_HINT_T1);
    }
#pragma GCC unroll 6
    for (int i = 0; i < kCount; ++i) {
      const __m512d x = _mm512_maskz_loadu_pd(mask, a + i * lda + r);
      b0 = _mm512_fnmadd_pd(x, c[i][0], b0);
      b1 = _mm512_fnmadd_pd(x, c[i][1], b1);
      b2 = _mm512_fnmadd_pd(x, c[i][2], b2);
      b3 = _mm512_fnmadd_pd(x, c[i][3], b3);
    }
    _mm512_store_pd(b + r, b0);
    _mm512_store_pd(b + ldb + r, b1);
    _mm512_store_pd(b + 2 * ldb + r, b2);
    _mm512_store_pd(b + 3 * ldb + r, b3);
  }
}

// Sums the lanes of a sum in fixed order.
CARILLON_AVX512 double add_lanes(const double* lane) {
  const __m256d half = _mm256_add_pd(_mm256_load_pd(lane), _mm256_load_pd(lane + 4));
  const __m128d quarter = _mm_add_pd(_mm_unpacklo_pd(_mm256_castpd256_pd128(half), _mm256_extractf128_pd(half, 1)),
                                     _mm_unpackhi_pd(_mm256_castpd256_pd128(half), _mm256_extractf128_pd(half, 1)));
  return _mm_cvtsd_f64(_mm_add_sd(quarter, _mm_unpackhi_pd(quarter, quarter)));
}

using TransposedTile = void (*)(const double*, std::ptrdiff_t, const double*, std::ptrdiff_t, std::ptrdiff_t, double*, Prefetch);
using SubtractTile = void (*)(const double*, std::ptrdiff_t, const double*, std::ptrdiff_t, double*, std::ptrdiff_t, std::ptrdiff_t,
                              Prefetch);
constexpr TransposedTile kTransposedTile[] = {nullptr,
                                              add_transposed_tile<1>,
                                              add_transposed_tile<2>,
                                              add_transposed_tile<3>,
                                              add_transposed_tile<4>,
                                              add_transposed_tile<5>,
                                              add_transposed_tile<6>};
constexpr SubtractTile kSubtractTile[] = {nullptr,          subtract_tile<1>, subtract_tile<2>, subtract_tile<3>,
                                          subtract_tile<4>, subtract_tile<5>, subtract_tile<6>};

// Panels of columns, aligned to cache lines, padded by zeros.
class PackedPanel {
 public:
  PackedPanel(std::ptrdiff_t rows, int columns)
      : stride_(rows), space_(static_cast<std::size_t>(rows) * round_up(columns, kTile) + 8, 0.0) {
    const auto misfit = reinterpret_cast<std::uintptr_t>(space_.data()) % 64;
    values_ = space_.data() + (misfit == 0 ? 0 : (64 - misfit) / sizeof(double));
  }
  double* get() { return values_; }
  std::ptrdiff_t stride() const { return stride_; }
  void load(const Columns& from, std::ptrdiff_t first, std::ptrdiff_t rows) {
    const std::ptrdiff_t rounded = std::min((rows + 7) / 8 * 8, stride_);
    for (int j = 0; j < from.count; ++j) {
      double* to = values_ + j * stride_;
      std::memcpy(to, from.column(j) + first, static_cast<std::size_t>(rows) * sizeof(double));
      std::fill(to + rows, to + rounded, 0.0);
    }
  }
  /// Scales row i by d[i].
  void scale(const double* d, std::ptrdiff_t rows, int columns) {
    for (int j = 0; j < columns; ++j) {
      double* column = values_ + j * stride_;
      for (std::ptrdiff_t i = 0; i < rows; ++i) column[i] *= d[i];
    }
  }
  void clear() { std::fill(space_.begin(), space_.end(), 0.0); }
  void store(const Columns& to, std::ptrdiff_t first, std::ptrdiff_t rows) const {
    for (int j = 0; j < to.count; ++j)
      std::memcpy(to.column(j) + first, values_ + j * stride_, static_cast<std::size_t>(rows) * sizeof(double));
  }

 private:
  std::ptrdiff_t stride_;
  std::vector<double> space_;
  double* values_ = nullptr;
};

/// Adds A^T P to small, P: packed rows [first, first + rows) of a narrow block.
class TransposedProducts {
 public:
  explicit TransposedProducts(int narrow) : narrow_(narrow), tiles_(round_up(narrow, kTile) / kTile), sums_(kLanes, tiles_) {}

  CARILLON_AVX512 void add(const Columns& a, std::ptrdiff_t first, std::ptrdiff_t rows, PackedPanel& panel, double* small,
                           int small_stride) {
    Strips strips(a, first, rows, kStripTransposed, tiles_);
    for (int i = 0; i < a.count; i += kWide) {
      const int wide = std::min(kWide, a.count - i);
      strips.begin_columns(i, wide);
      std::fill_n(sums_.get(), static_cast<std::ptrdiff_t>(tiles_) * kLanes, 0.0);
      for (std::ptrdiff_t r = 0; r < rows; r += kStripTransposed) {
        const std::ptrdiff_t strip = std::min(kStripTransposed, rows - r);
        strips.begin_strip(r);
        for (int j = 0; j < tiles_; ++j) {
          kTransposedTile[wide](a.column(i) + first + r, a.stride, panel.get() + j * kTile * panel.stride() + r, panel.stride(), strip,
                                sums_.get() + j * kLanes, strips.find_prefetch(j));
        }
      }
      for (int j = 0; j < narrow_; ++j) {
        for (int k = 0; k < wide; ++k) {
          const double* lane = sums_.get() + (j / kTile) * kLanes + 8 * (k * kTile + j % kTile);
          small[static_cast<std::ptrdiff_t>(j) * small_stride + i + k] += add_lanes(lane);
        }
      }
    }
  }

 private:
  static constexpr int kLanes = 8 * kWide * kTile;  // of the sums of a tile
  int narrow_;
  int tiles_;
  PackedPanel sums_;
};

/// S of a product, padded by zero columns to whole tiles.
class PackedCoefficients {
 public:
  PackedCoefficients(const double* s, int s_stride, int rows, int columns)
      : rows_(rows), values_(static_cast<std::size_t>(rows) * static_cast<std::size_t>(round_up(columns, kTile)), 0.0) {
    for (int j = 0; j < columns; ++j)
      std::copy_n(s + static_cast<std::ptrdiff_t>(j) * s_stride, rows, values_.data() + static_cast<std::ptrdiff_t>(j) * rows);
  }
  int rows() const { return rows_; }
  const double* column(int j) const { return values_.data() + static_cast<std::ptrdiff_t>(j) * rows_; }

 private:
  int rows_;
  std::vector<double> values_;
};

// P -= A S, P: packed rows [first, first + rows) of a block of `narrow` columns.
void subtract_from_panel(const Columns& a, const PackedCoefficients& s, std::ptrdiff_t first, std::ptrdiff_t rows, int narrow,
                         PackedPanel& panel) {
  const int tiles = round_up(narrow, kTile) / kTile;
  Strips strips(a, first, rows, kStripProduct, tiles);
  for (int i = 0; i < a.count; i += kWide) {
    const int wide = std::min(kWide, a.count - i);
    strips.begin_columns(i, wide);
    for (std::ptrdiff_t r = 0; r < rows; r += kStripProduct) {
      const std::ptrdiff_t strip = std::min(kStripProduct, rows - r);
      strips.begin_strip(r);
      for (int j = 0; j < tiles; ++j) {
        kSubtractTile[wide](a.column(i) + first + r, a.stride, s.column(j * kTile) + i, s.rows(),
                            panel.get() + j * kTile * panel.stride() + r, panel.stride(), strip, strips.find_prefetch(j));
      }
    }
  }
}

void multiply_transposed_avx512(const Columns& a, const Columns& b, double* small, int small_stride) {
  for (int j = 0; j < b.count; ++j) std::fill_n(small + static_cast<std::ptrdiff_t>(j) * small_stride, a.count, 0.0);
  PackedPanel panel(kRowsTransposed, b.count);
  TransposedProducts products(b.count);
  for (std::ptrdiff_t first = 0; first < a.rows; first += kRowsTransposed) {
    const std::ptrdiff_t rows = std::min(kRowsTransposed, a.rows - first);
    panel.load(b, first, rows);
    products.add(a, first, rows, panel, small, small_stride);
  }
}

void subtract_product_avx512(const Columns& a, const double* small, int small_stride, const Columns& b) {
  const PackedCoefficients s(small, small_stride, a.count, b.count);
  PackedPanel panel(kRowsProduct, b.count);
  for (std::ptrdiff_t first = 0; first < a.rows; first += kRowsProduct) {
    const std::ptrdiff_t rows = std::min(kRowsProduct, a.rows - first);
    panel.load(b, first, rows);
    subtract_from_panel(a, s, first, rows, b.count, panel);
    panel.store(b, first, rows);
  }
}

void subtract_and_multiply_transposed_avx512(const Product& product, int s_stride, const double* d, const Columns& b,
                                             std::span<const Columns> c, double* small, int small_stride) {
  const PackedCoefficients s(product.s, s_stride, product.a.count, b.count);
  PackedPanel panel(kRowsFused, b.count);
  TransposedProducts products(b.count);
  for (std::ptrdiff_t first = 0; first < b.rows; first += kRowsFused) {
    const std::ptrdiff_t rows = std::min(kRowsFused, b.rows - first);
    panel.load(b, first, rows);
    if (product.a.count > 0) {
      subtract_from_panel(product.a, s, first, rows, b.count, panel);
      panel.store(b, first, rows);
    }
    panel.scale(d + first, rows, b.count);
    double* at = small;
    for (const Columns& set : c) {
      products.add(set, first, rows, panel, at, small_stride);
      at += set.count;
    }
  }
}

void subtract_and_combine_avx512(std::span<const Product> products, int s_stride, const double* t, const double* d, const Columns& b,
                                 const Columns& z) {
  std::vector<PackedCoefficients> s;
  for (const Product& product : products) s.emplace_back(product.s, s_stride, product.a.count, b.count);
  std::vector<double> negative(static_cast<std::size_t>(b.count) * static_cast<std::size_t>(b.count), 0.0);  // -T
  for (std::size_t i = 0; t != nullptr && i < negative.size(); ++i) negative[i] = -t[i];
  const PackedCoefficients combination(negative.data(), b.count, b.count, b.count);
  PackedPanel panel(kRowsFused, b.count);
  PackedPanel combined(kRowsFused, b.count);
  const Columns loaded{panel.get(), kRowsFused, panel.stride(), b.count};
  for (std::ptrdiff_t first = 0; first < b.rows; first += kRowsFused) {
    const std::ptrdiff_t rows = std::min(kRowsFused, b.rows - first);
    panel.load(b, first, rows);
    for (std::size_t k = 0; k < products.size(); ++k) subtract_from_panel(products[k].a, s[k], first, rows, b.count, panel);
    if (t != nullptr) {
      combined.clear();
      subtract_from_panel(loaded, combination, 0, rows, b.count, combined);
    }
    PackedPanel& result = t != nullptr ? combined : panel;
    result.store(b, first, rows);
    result.scale(d + first, rows, b.count);
    result.store(z, first, rows);
  }
}

constexpr int kRowTile = 24;    // rows and
constexpr int kColumnTile = 8;  // columns of A S in registers
constexpr int kStripTiles = 4;  // row tiles that share a packed tile of S in the first-level cache

// c (24 x 8) = a s; a: packed (count x 24), s: packed (count x 8). Stores `columns` columns of `rows` rows.
CARILLON_AVX512 void combine_tile(const double* a, const double* s, int count, double* c, std::ptrdiff_t ldc, int rows, int columns) {
  __m512d sum[3][kColumnTile];
#pragma GCC unroll 3
  for (int i = 0; i < 3; ++i) {
#pragma GCC unroll 8
    for (int j = 0; j < kColumnTile; ++j) sum[i][j] = _mm512_setzero_pd();
  }
  for (int k = 0; k < count; ++k) {
    const __m512d a0 = _mm512_loadu_pd(a + k * kRowTile), a1 = _mm512_loadu_pd(a + k * kRowTile + 8),
                  a2 = _mm512_loadu_pd(a + k * kRowTile + 16);
#pragma GCC unroll 8
    for (int j = 0; j < kColumnTile; ++j) {
      const __m512d x = _mm512_set1_pd(s[k * kColumnTile + j]);
      sum[0][j] = _mm512_fmadd_pd(a0, x, sum[0][j]);
      sum[1][j] = _mm512_fmadd_pd(a1, x, sum[1][j]);
      sum[2][j] = _mm512_fmadd_pd(a2, x, sum[2][j]);
    }
  }
#pragma GCC unroll 3
  for (int i = 0; i < 3; ++i) {
    const int left = std::clamp(rows - 8 * i, 0, 8);
    const auto mask = static_cast<__mmask8>((1 << left) - 1);
#pragma GCC unroll 8
    for (int j = 0; j < kColumnTile; ++j) {
      if (j < columns) _mm512_mask_storeu_pd(c + j * ldc + 8 * i, mask, sum[i][j]);
    }
  }
}

void combine_columns_avx512(const Columns& a, const double* small, int kept) {
  const int groups = (kept + kColumnTile - 1) / kColumnTile;
  const auto count = static_cast<std::ptrdiff_t>(a.count);
  std::vector<double> packed(static_cast<std::size_t>(groups) * static_cast<std::size_t>(count) * kColumnTile, 0.0);
  for (int j = 0; j < kept; ++j) {
    double* to = packed.data() + (j / kColumnTile) * count * kColumnTile + j % kColumnTile;
    for (std::ptrdiff_t k = 0; k < count; ++k) to[k * kColumnTile] = small[j * count + k];
  }
  std::vector<double> panel(static_cast<std::size_t>(kStripTiles * kRowTile) * static_cast<std::size_t>(count), 0.0);
  for (std::ptrdiff_t first = 0; first < a.rows; first += kStripTiles * kRowTile) {
    const std::ptrdiff_t rows = std::min<std::ptrdiff_t>(kStripTiles * kRowTile, a.rows - first);
    for (std::ptrdiff_t k = 0; k < count; ++k) {
      const double* from = a.values + k * a.stride + first;
      for (std::ptrdiff_t r = 0; r < rows; r += kRowTile)
        std::copy_n(from + r, std::min<std::ptrdiff_t>(kRowTile, rows - r), panel.data() + (r * count) + k * kRowTile);
    }
    for (int g = 0; g < groups; ++g) {
      for (std::ptrdiff_t r = 0; r < rows; r += kRowTile) {
        combine_tile(panel.data() + r * count, packed.data() + g * count * kColumnTile, a.count, a.column(g * kColumnTile) + first + r,
                     a.stride, static_cast<int>(std::min<std::ptrdiff_t>(kRowTile, rows - r)),
                     std::min(kColumnTile, kept - g * kColumnTile));
      }
    }
  }
}
#else
bool has_avx512() { return false; }
void multiply_transposed_avx512(const Columns&, const Columns&, double*, int) {}
void subtract_product_avx512(const Columns&, const double*, int, const Columns&) {}
void subtract_and_multiply_transposed_avx512(const Product&, int, const double*, const Columns&, std::span<const Columns>, double*, int) {}
void subtract_and_combine_avx512(std::span<const Product>, int, const double*, const double*, const Columns&, const Columns&) {}
void combine_columns_avx512(const Columns&, const double*, int) {}
#endif

// Rows [first, first + rows) of some columns.
Columns take_rows(const Columns& from, std::ptrdiff_t first, std::ptrdiff_t rows) {
  return {from.values + first, rows, from.stride, from.count};
}

void subtract_by_blas(const Columns& a, const double* s, int s_stride, const Columns& b) {
  gemm(Transpose::kNo, b.rows, b.count, a.count, -1.0, a.values, a.stride, s, s_stride, 1.0, b.values, b.stride);
}

// Z = D B
void scale_rows(const double* d, const Columns& b, const Columns& z) {
  for (int j = 0; j < b.count; ++j) {
    for (std::ptrdiff_t i = 0; i < b.rows; ++i) z.column(j)[i] = d[i] * b.column(j)[i];
  }
}

}  // namespace

void multiply_transposed(const Columns& a, const Columns& b, double* small, int small_stride) {
  if (a.count == 0 || b.count == 0) return;
  petsc::add_flops(2.0 * static_cast<double>(a.rows) * a.count * b.count);
  if (b.count <= kNarrow && has_avx512()) return multiply_transposed_avx512(a, b, small, small_stride);
  if (a.count <= kNarrow && has_avx512()) {  // Transposed product with exchanged operands.
    Matrix turned(b.count, a.count);
    multiply_transposed_avx512(b, a, turned.data(), b.count);
    for (int j = 0; j < b.count; ++j)
      for (int i = 0; i < a.count; ++i) small[static_cast<std::ptrdiff_t>(j) * small_stride + i] = turned(j, i);
    return;
  }
  gemm(Transpose::kYes, a.count, b.count, a.rows, 1.0, a.values, a.stride, b.values, b.stride, 0.0, small, small_stride);
}

Matrix multiply_transposed(const comm::Communicator& comm, const Columns& a, const Columns& b) {
  Matrix products = Matrix::Zero(a.count, b.count);
  multiply_transposed(a, b, products.data(), a.count);
  comm.sum(entries(products));
  return products;
}

void subtract_product(const Columns& a, const double* small, int small_stride, const Columns& b) {
  if (a.count == 0 || b.count == 0) return;
  petsc::add_flops(2.0 * static_cast<double>(a.rows) * a.count * b.count);
  if (b.count <= kNarrow && has_avx512()) return subtract_product_avx512(a, small, small_stride, b);
  subtract_by_blas(a, small, small_stride, b);
}

void subtract_and_multiply_transposed(const Product& product, int s_stride, const double* d, const Columns& b, std::span<const Columns> c,
                                      double* small, int small_stride) {
  int all = product.a.count;
  for (const Columns& set : c) all += set.count;
  petsc::add_flops(2.0 * static_cast<double>(b.rows) * all * b.count);
  for (int j = 0; j < b.count; ++j) std::fill_n(small + static_cast<std::ptrdiff_t>(j) * small_stride, all - product.a.count, 0.0);
  if (b.count <= kNarrow && has_avx512()) return subtract_and_multiply_transposed_avx512(product, s_stride, d, b, c, small, small_stride);
  std::vector<double> space(static_cast<std::size_t>(kRowsFused) * static_cast<std::size_t>(b.count));
  for (std::ptrdiff_t first = 0; first < b.rows; first += kRowsFused) {
    const std::ptrdiff_t rows = std::min(kRowsFused, b.rows - first);
    const Columns panel = take_rows(b, first, rows);
    const Columns scaled{space.data(), rows, kRowsFused, b.count};
    if (product.a.count > 0) subtract_by_blas(take_rows(product.a, first, rows), product.s, s_stride, panel);
    scale_rows(d + first, panel, scaled);
    double* at = small;
    for (const Columns& set : c) {
      if (set.count > 0)
        gemm(Transpose::kYes, set.count, b.count, rows, 1.0, set.values + first, set.stride, scaled.values, kRowsFused, 1.0, at,
             small_stride);
      at += set.count;
    }
  }
}

void subtract_and_combine(std::span<const Product> products, int s_stride, const double* t, const double* d, const Columns& b,
                          const Columns& z) {
  int all = t != nullptr ? b.count : 0;
  for (const Product& product : products) all += product.a.count;
  petsc::add_flops(2.0 * static_cast<double>(b.rows) * all * b.count);
  if (b.count <= kNarrow && has_avx512()) return subtract_and_combine_avx512(products, s_stride, t, d, b, z);
  for (std::ptrdiff_t first = 0; first < b.rows; first += kRowsFused) {
    const std::ptrdiff_t rows = std::min(kRowsFused, b.rows - first);
    const Columns panel = take_rows(b, first, rows);
    const Columns image = take_rows(z, first, rows);
    for (const Product& product : products) {
      if (product.a.count > 0) subtract_by_blas(take_rows(product.a, first, rows), product.s, s_stride, panel);
    }
    if (t != nullptr) {
      gemm(Transpose::kNo, rows, b.count, b.count, 1.0, panel.values, panel.stride, t, b.count, 0.0, image.values, image.stride);
      for (int j = 0; j < b.count; ++j) std::copy_n(image.column(j), rows, panel.column(j));
    }
    scale_rows(d + first, panel, image);
  }
}

void combine_columns(const Columns& a, const double* small, int kept) {
  if (a.count == 0 || kept == 0) return;
  petsc::add_flops(2.0 * static_cast<double>(a.rows) * a.count * kept);
  if (has_avx512()) return combine_columns_avx512(a, small, kept);
  std::vector<double> panel(static_cast<std::size_t>(kRowsCombined) * static_cast<std::size_t>(a.count));
  for (std::ptrdiff_t first = 0; first < a.rows; first += kRowsCombined) {
    const std::ptrdiff_t rows = std::min(kRowsCombined, a.rows - first);
    for (int j = 0; j < a.count; ++j) std::copy_n(a.column(j) + first, rows, panel.data() + j * kRowsCombined);
    gemm(Transpose::kNo, rows, kept, a.count, 1.0, panel.data(), kRowsCombined, small, a.count, 0.0, a.values + first, a.stride);
  }
}

}  // namespace carillon::la
