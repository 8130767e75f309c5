// Method:     Diagonal blocks: right-looking L D L^T with rook pivoting on the full square in the first-level cache, then the inverse of L
//             by rows. Products of tiles with strips keep a tile's sums in registers.
// Source:     Goto and van de Geijn 2008, Anatomy of high-performance matrix multiplication. Ashcraft, Grimes, Lewis 1998, Accurate
//             symmetric indefinite linear equation solvers (rook pivoting; LAPACK's dsytf2_rk). Schenk and Gaertner 2006, On fast
//             factorization pivoting methods for sparse symmetric indefinite systems (pivoting inside supernodes).
// Deviations: pivots that are small for lack of choice are not perturbed: the backward error is measured instead.
#include "precompute/ldlt/kernels.hpp"
#include "runtime/base/simd.hpp"

HWY_BEFORE_NAMESPACE();
namespace carillon::ldlt::HWY_NAMESPACE {
namespace {

constexpr int kWidth = CARILLON_REGISTER_BYTES / sizeof(double);
typedef double Vector __attribute__((vector_size(8 * kWidth)));
/// Rows and vectors of a product that the registers hold.
constexpr int kRows = kWidth == 8 ? 12 : 6;
constexpr int kVectors = 2;

inline double magnitude(double x) { return __builtin_fabs(x); }

/// Largest magnitude in column c of the rows from `begin` on, row `skip` left out.
inline double find_largest(const double* block, int n, int c, int begin, int skip, int& at) {
  double largest = -1;
  const double* column = block + c * kMaxBlock;
  for (int i = begin; i < n; ++i) {
    const double value = i == skip ? -1 : magnitude(column[i]);
    if (value > largest) {
      largest = value;
      at = i;
    }
  }
  return largest;
}

/// Exchanges rows and columns a and b of what is left from k on, and the rows of L before.
inline void exchange(double* block, int n, int k, int a, int b, int* order) {
  if (a == b) return;
  for (int j = 0; j < n; ++j) {
    const double t = block[j * kMaxBlock + a];
    block[j * kMaxBlock + a] = block[j * kMaxBlock + b];
    block[j * kMaxBlock + b] = t;
  }
  for (int i = k; i < n; ++i) {
    const double t = block[a * kMaxBlock + i];
    block[a * kMaxBlock + i] = block[b * kMaxBlock + i];
    block[b * kMaxBlock + i] = t;
  }
  const int t = order[a];
  order[a] = order[b];
  order[b] = t;
}

/// Picks the pivot of step k and brings it to the front: its order, 1 or 2.
inline int choose_pivot(double* block, int n, int k, int* order) {
  constexpr double kAlpha = 0.6403882032022076;  // (1 + sqrt 17) / 8: equal growth of 1x1 and 2x2 pivots
  if (k == n - 1) return 1;
  int row = k;
  double largest = find_largest(block, n, k, k + 1, -1, row);
  if (magnitude(block[k * kMaxBlock + k]) >= kAlpha * largest) return 1;
  int before = k;
  while (true) {
    int next = before;
    const double other = find_largest(block, n, row, k, row, next);
    if (magnitude(block[row * kMaxBlock + row]) >= kAlpha * other) {
      exchange(block, n, k, k, row, order);
      return 1;
    }
    if (next == before || other <= largest) {
      exchange(block, n, k, k, before, order);
      exchange(block, n, k, k + 1, row == k ? before : row, order);
      return 2;
    }
    before = row;
    largest = other;
    row = next;
  }
}

inline void eliminate_one(double* block, int n, int k) {
  double* column = block + k * kMaxBlock;
  const double inverse = 1.0 / column[k];
  double multiplier[kMaxBlock];
  for (int i = k + 1; i < n; ++i) multiplier[i] = column[i] * inverse;
  for (int j = k + 1; j < n; ++j) {
    double* target = block + j * kMaxBlock;
    const double factor = column[j];
    for (int i = k + 1; i < n; ++i) target[i] -= multiplier[i] * factor;
  }
  for (int i = k + 1; i < n; ++i) column[i] = multiplier[i];
}

inline void eliminate_two(double* block, int n, int k, double d00, double d10, double d11) {
  double* c0 = block + k * kMaxBlock;
  double* c1 = c0 + kMaxBlock;
  double m0[kMaxBlock];
  double m1[kMaxBlock];
  for (int i = k + 2; i < n; ++i) {
    m0[i] = c0[i] * d00 + c1[i] * d10;
    m1[i] = c0[i] * d10 + c1[i] * d11;
  }
  for (int j = k + 2; j < n; ++j) {
    double* target = block + j * kMaxBlock;
    const double f0 = c0[j];
    const double f1 = c1[j];
    for (int i = k + 2; i < n; ++i) target[i] -= m0[i] * f0 + m1[i] * f1;
  }
  for (int i = k + 2; i < n; ++i) {
    c0[i] = m0[i];
    c1[i] = m1[i];
  }
  c0[k + 1] = 0;
}

/// L^-1 to tiles: row i is e_i less multiples of the rows before.
inline void invert_block(const double* block, int n, double* tiles) {
  alignas(64) static thread_local double inverse[kMaxBlock * kMaxBlock];
  for (int i = 0; i < n; ++i) {
    double* row = inverse + i * kMaxBlock;
    for (int j = 0; j < kMaxBlock; ++j) row[j] = 0;
    row[i] = 1;
    for (int k = 0; k < i; ++k) {
      const double factor = block[k * kMaxBlock + i];
      const double* above = inverse + k * kMaxBlock;
      for (int j = 0; j <= k; ++j) row[j] -= factor * above[j];
    }
  }
  for (int i = 0; i < n; i += kTileRows) {
    const int height = n - i < kTileRows ? n - i : kTileRows;
    for (int k = 0; k < i + height; ++k)
      for (int r = 0; r < height; ++r) *tiles++ = inverse[(i + r) * kMaxBlock + k];
  }
}

bool factorise_block(double* block, int n, BlockPivots& pivots, double* tiles) {
  int* order = pivots.order;
  for (int k = 0; k < n; ++k) order[k] = k;
  pivots.negative = 0;
  pivots.smallest = __builtin_inf();
  for (int k = 0; k < n;) {
    const int kind = choose_pivot(block, n, k, order);
    const double a = block[k * kMaxBlock + k];
    pivots.off[k] = 0;
    double size = magnitude(a);
    if (kind == 1) {
      if (!(size > 0) || !__builtin_isfinite(a)) return false;
      pivots.diagonal[k] = 1.0 / a;
      pivots.negative += a < 0;
      eliminate_one(block, n, k);
    } else {
      const double b = block[k * kMaxBlock + k + 1];
      const double c = block[(k + 1) * kMaxBlock + k + 1];
      // Scaled by b, the largest of the three, as LAPACK does.
      const double ratio_a = a / b;
      const double ratio_c = c / b;
      const double determinant = ratio_a * ratio_c - 1;  // of the block, over b^2; not above -0.59
      if (!(magnitude(determinant) > 0) || !__builtin_isfinite(determinant) || !__builtin_isfinite(b)) return false;
      const double scale = 1.0 / (b * determinant);
      pivots.diagonal[k] = ratio_c * scale;
      pivots.diagonal[k + 1] = ratio_a * scale;
      pivots.off[k] = -scale;
      pivots.off[k + 1] = 0;
      pivots.negative += determinant < 0 ? 1 : (a < 0 ? 2 : 0);
      size = magnitude(b) * magnitude(determinant) / (2 + magnitude(ratio_a) + magnitude(ratio_c));
      eliminate_two(block, n, k, pivots.diagonal[k], pivots.off[k], pivots.diagonal[k + 1]);
    }
    if (size < pivots.smallest) pivots.smallest = size;
    k += kind;
  }
  invert_block(block, n, tiles);
  return true;
}

typedef double Quad __attribute__((vector_size(32)));
typedef double UnalignedQuad __attribute__((vector_size(32), aligned(8)));

inline Quad load(const double* from) { return *reinterpret_cast<const UnalignedQuad*>(from); }
inline void store(double* to, Quad value) { *reinterpret_cast<UnalignedQuad*>(to) = value; }
inline Quad find_larger(Quad a, Quad b) {
  const Quad size = b < 0 ? -b : b;
  return size > a ? size : a;
}

typedef double UnalignedVector __attribute__((vector_size(8 * kWidth), aligned(8)));
constexpr int kLanes = kWideRows / kWidth;  // vectors in a row of a strip

inline Vector load_vector(const double* from) { return *reinterpret_cast<const UnalignedVector*>(from); }
inline void store_vector(double* to, Vector value) { *reinterpret_cast<UnalignedVector*>(to) = value; }

/// sum += (or -=) kCount rows of a tile, times some of the 16 numbers in each row of a strip.
template <int kHeight, bool kMinus, int kCount, int kUsed>
inline void add_outer(const double* tile, const Vector* strip, int n, Vector (&sum)[kCount][kUsed]) {
  for (int k = 0; k < n; ++k) {
    Vector row[kUsed];
#pragma GCC unroll 2
    for (int v = 0; v < kUsed; ++v) row[v] = strip[k * kLanes + v];
#pragma GCC unroll 12
    for (int i = 0; i < kCount; ++i)
#pragma GCC unroll 2
      for (int v = 0; v < kUsed; ++v)
        sum[i][v] = kMinus ? sum[i][v] - row[v] * tile[k * kHeight + i] : sum[i][v] + row[v] * tile[k * kHeight + i];
  }
}

/// out (kHeight rows of 16 numbers) = tile times strip.
template <int kHeight, int kBegin = 0>
inline void multiply_strip(const double* tile, const Vector* strip, int n, Vector* out) {
  if constexpr (kBegin < kHeight) {
    constexpr int kCount = kHeight - kBegin < kRows ? kHeight - kBegin : kRows;
    for (int v = 0; v < kLanes; v += kVectors) {
      Vector sum[kCount][kVectors] = {};
      add_outer<kHeight, false>(tile + kBegin, strip + v, n, sum);
#pragma GCC unroll 12
      for (int i = 0; i < kCount; ++i)
#pragma GCC unroll 2
        for (int u = 0; u < kVectors; ++u) out[(kBegin + i) * kLanes + v + u] = sum[i][u];
    }
    multiply_strip<kHeight, kBegin + kCount>(tile, strip, n, out);
  }
}

/// The same, subtracted from (or put with a minus to) columns of C, from their row `row` on.
template <int kHeight, int kBegin = 0>
inline void update_block(const double* tile, const Vector* strip, int n, bool is_set, double* const* columns, long row) {
  if constexpr (kBegin < kHeight) {
    constexpr int kCount = kHeight - kBegin < kRows ? kHeight - kBegin : kRows;
    for (int v = 0; v < kLanes; v += kVectors) {
      if (!is_set)
#pragma GCC unroll 12
        for (int i = 0; i < kCount; ++i)
#pragma GCC unroll 2
          for (int u = 0; u < kVectors; ++u) __builtin_prefetch(columns[kBegin + i] + row + kWidth * (v + u), 1);
      Vector sum[kCount][kVectors] = {};
      add_outer<kHeight, true>(tile + kBegin, strip + v, n, sum);
#pragma GCC unroll 12
      for (int i = 0; i < kCount; ++i) {
        double* target = columns[kBegin + i] + row + kWidth * v;
#pragma GCC unroll 2
        for (int u = 0; u < kVectors; ++u)
          store_vector(target + kWidth * u, is_set ? sum[i][u] : load_vector(target + kWidth * u) + sum[i][u]);
      }
    }
    update_block<kHeight, kBegin + kCount>(tile, strip, n, is_set, columns, row);
  }
}

void trsm(const double* const* columns, int begin, int end, int n, const double* triangle, double* wide) {
  Vector sums[kTileRows * kLanes];
  for (int row = begin; row < end; row += kWideRows, wide += kWideRows * n) {
    auto* strip = reinterpret_cast<Vector*>(wide);
    if (row + kWideRows <= end) {
      for (int k = 0; k < n; ++k)
        for (int v = 0; v < kLanes; ++v) strip[k * kLanes + v] = load_vector(columns[k] + row + kWidth * v);
    } else {
      for (int k = 0; k < n; ++k)
        for (int r = 0; r < kWideRows; ++r) wide[k * kWideRows + r] = row + r < end ? columns[k][row + r] : 0;
    }
    // From the last tile back: none needs rows behind its own, so W takes the place of A.
    int i = n / kTileRows * kTileRows;
    const double* tile = triangle + i * (i + kTileRows) / 2;
    const int rest = n - i;
    if (rest == 9) multiply_strip<9>(tile, strip, n, sums);
    if (rest == 6) multiply_strip<6>(tile, strip, n, sums);
    if (rest == 3) multiply_strip<3>(tile, strip, n, sums);
    for (int k = 0; k < rest * kLanes; ++k) strip[i * kLanes + k] = sums[k];
    while (i > 0) {
      tile -= kTileRows * i;
      multiply_strip<kTileRows>(tile, strip, i, sums);
      i -= kTileRows;
      for (int k = 0; k < kTileRows * kLanes; ++k) strip[i * kLanes + k] = sums[k];
    }
  }
}

void scale_by_d_inverse(const double* wide, int begin, int m, int n, const BlockPivots& pivots, double* tiles, double& growth) {
  constexpr int kParts = kTileRows / 4;
  Quad largest{};
  for (int row = 0; row < m; row += kTileRows) {
    const int height = m - row < kTileRows ? m - row : kTileRows;
    const double* part[kParts];
    for (int q = 0; q < kParts; ++q) {
      const int at = begin + (4 * q < height ? row + 4 * q : row);  // there is no strip behind the last row
      part[q] = wide + static_cast<long>(at / kWideRows) * kWideRows * n + at % kWideRows;
    }
    for (int k = 0; k < n; ++k) {
      const double diagonal = pivots.diagonal[k];
      Quad value[kParts];
      for (int q = 0; q < kParts; ++q) value[q] = load(part[q] + k * kWideRows) * diagonal;
      if (pivots.off[k] != 0)
        for (int q = 0; q < kParts; ++q) value[q] += load(part[q] + (k + 1) * kWideRows) * pivots.off[k];
      if (k > 0 && pivots.off[k - 1] != 0)
        for (int q = 0; q < kParts; ++q) value[q] += load(part[q] + (k - 1) * kWideRows) * pivots.off[k - 1];
      for (int q = 0; q < kParts; ++q) largest = find_larger(largest, value[q]);
      if (height == kTileRows) {
        for (int q = 0; q < kParts; ++q) store(tiles + 4 * q, value[q]);
      } else {
        double rows[kTileRows];
        for (int q = 0; q < kParts; ++q) store(rows + 4 * q, value[q]);
        for (int r = 0; r < height; ++r) tiles[r] = rows[r];
      }
      tiles += height;
    }
  }
  for (int q = 0; q < 4; ++q) growth = largest[q] > growth ? largest[q] : growth;
}

/// The same for blocks of which only the rows `from` to `behind` are stored.
template <int kHeight>
inline void update_edge(const double* tile, const Vector* strip, int n, bool is_set, double* const* columns, int row, int from,
                        int behind) {
  alignas(64) double sums[kHeight * kWideRows];
  multiply_strip<kHeight>(tile, strip, n, reinterpret_cast<Vector*>(sums));
  for (int j = 0; j < kHeight; ++j) {
    double* target = columns[j];
    const double* sum = sums + j * kWideRows - row;
    int i = from;
    for (; i + 4 <= behind; i += 4) store(target + i, (is_set ? Quad{} : load(target + i)) - load(sum + i));
    for (; i < behind; ++i) target[i] = (is_set ? 0 : target[i]) - sum[i];
  }
}

/// The rows from `from` on, in blocks that lie between begin and behind.
template <int kHeight>
inline void update_tile(const Panel& panel, int column, int from, int begin, int behind, int end, bool is_set, double* const* columns) {
  const double* tile = panel.tiles + static_cast<long>(column - panel.begin) * panel.n;
  if (begin < column) begin += (column - begin) / kWideRows * kWideRows;
  for (int row = begin; row < behind; row += kWideRows) {
    const auto* strip = reinterpret_cast<const Vector*>(panel.wide + static_cast<long>(row - panel.begin) * panel.n);
    if (row >= from && row + kWideRows <= end)
      update_block<kHeight>(tile, strip, panel.n, is_set, columns + column, row);
    else
      update_edge<kHeight>(tile, strip, panel.n, is_set, columns + column, row, row > from ? row : from,
                           row + kWideRows < end ? row + kWideRows : end);
  }
}

void update(const Panel& panel, int pivots, int end, bool is_made, double* const* columns) {
  constexpr int kStripNumbers = 1 << 16;  // 512 KB of strips stay in the second-level cache while the tiles pass
  const int rows = kStripNumbers / (kWideRows * panel.n) * kWideRows;
  for (int begin = panel.begin; begin < end; begin += rows) {
    const int behind = begin + rows < end ? begin + rows : end;
    for (int column = panel.begin; column < behind; column += kTileRows) {
      const bool is_pivot = column < pivots;
      const bool is_set = is_made && !is_pivot;
      const int from = is_pivot ? panel.begin : pivots + (column - pivots) / kStripColumns * kStripColumns;
      const int height = end - column;
      if (height >= kTileRows)
        update_tile<kTileRows>(panel, column, from, begin, behind, end, is_set, columns);
      else if (height == 9)
        update_tile<9>(panel, column, from, begin, behind, end, is_set, columns);
      else if (height == 6)
        update_tile<6>(panel, column, from, begin, behind, end, is_set, columns);
      else
        update_tile<3>(panel, column, from, begin, behind, end, is_set, columns);
    }
  }
}

/// Some of the rows of update_columns, which begin with a strip.
template <int kHeight>
inline void update_rows(const double* tile, const double* wide, int first, int behind, int begin, int end, int n, double* const* columns) {
  for (int row = first; row < behind; row += kWideRows) {
    const auto* strip = reinterpret_cast<const Vector*>(wide + static_cast<long>(row) * n);
    if (row >= begin && row + kWideRows <= end)
      update_block<kHeight>(tile, strip, n, false, columns, row);
    else
      update_edge<kHeight>(tile, strip, n, false, columns, row, row > begin ? row : begin, row + kWideRows < end ? row + kWideRows : end);
  }
}

void update_columns(const double* tiles, int width, const double* wide, int begin, int end, int n, double* const* columns) {
  constexpr int kStripNumbers = 1 << 16;  // as in update
  const int rows = kStripNumbers / (kWideRows * n) * kWideRows;
  for (int first = begin / kWideRows * kWideRows; first < end; first += rows) {
    const int behind = first + rows < end ? first + rows : end;
    for (int column = 0; column < width; column += kTileRows) {
      const double* tile = tiles + static_cast<long>(column) * n;
      const int height = width - column;
      if (height >= kTileRows)
        update_rows<kTileRows>(tile, wide, first, behind, begin, end, n, columns + column);
      else if (height == 9)
        update_rows<9>(tile, wide, first, behind, begin, end, n, columns + column);
      else if (height == 6)
        update_rows<6>(tile, wide, first, behind, begin, end, n, columns + column);
      else
        update_rows<3>(tile, wide, first, behind, begin, end, n, columns + column);
    }
  }
}

inline void add_run(const double* __restrict__ from, double* __restrict__ to, int length) {
  int i = 0;
  for (; i + 4 <= length; i += 4) store(to + i, load(to + i) + load(from + i));
  for (; i < length; ++i) to[i] += from[i];
}

void extend_add(const double* const* source, const RowRun* runs, int count, double* const* target) {
  for (int c = 0; c < 3; ++c) add_run(source[c] + runs[0].from + c, target[c] + runs[0].to + c, runs[0].length - c);
  for (int k = 1; k < count; ++k)
    for (int c = 0; c < 3; ++c) add_run(source[c] + runs[k].from, target[c] + runs[k].to, runs[k].length);
}

const FactorKernels kTable{factorise_block, trsm, scale_by_d_inverse, update, update_columns, extend_add};

const FactorKernels& get_kernels() { return kTable; }

}  // namespace
}  // namespace carillon::ldlt::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace carillon::ldlt {

HWY_EXPORT(get_kernels);

const FactorKernels& find_factor_kernels() { return base::choose(HWY_DISPATCH_TABLE(get_kernels))(); }

}  // namespace carillon::ldlt
#endif
