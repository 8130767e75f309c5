// One body of loops, compiled for each set of instructions; longer than most files.
// Method:     Products of tiles with up to 16 right-hand sides keep a tile's sums in registers; every number of L is read once, in order,
//             and multiplied into whole vectors. Diagonal blocks: right-looking L D L^T with rook pivoting on the full square in the
//             first-level cache, then the inverse of L by rows.
// Source:     Goto and van de Geijn 2008, Anatomy of high-performance matrix multiplication. Ashcraft, Grimes, Lewis 1998, Accurate
//             symmetric indefinite linear equation solvers (rook pivoting; LAPACK's dsytf2_rk). Schenk and Gaertner 2006, On fast
//             factorization pivoting methods for sparse symmetric indefinite systems (pivoting inside supernodes).
// Deviations: pivots that are small for lack of choice are not perturbed: the backward error is measured instead.
//
// Included by one .cpp per instruction set, which sets CARILLON_ISA (a namespace), kRows and kVectors: what its registers hold. Nothing of
// the standard library is instantiated here, since its inline functions would be merged with those of other files.
#include "precompute/ldlt/kernels.hpp"

namespace carillon::ldlt::CARILLON_ISA {
namespace {

typedef double Vector __attribute__((vector_size(64)));

/// Numbers of L to prefetch, from memory to the second-level cache and then to the first: the order of use inside a tile is
/// not what the processor predicts.
constexpr int kFar = 1024;
constexpr int kNear = 256;
constexpr int kLine = 8;
inline void prefetch(const double* far, const double* near) {
  __builtin_prefetch(far, 0, 2);
  __builtin_prefetch(near);
}

/// What is read from one end to the other, and what will be read then.
struct Reading {
  const double* end;
  const double* next;
  const double* find_ahead(const double* at, long ahead) const { return end - at > ahead ? at + ahead : next + (ahead - (end - at)); }
};

/// The 12 rows of right-hand sides that belong to a tile: three for each of four nodes.
template <int kStride>
struct TileRows {
  Vector* node[kTileRows / 3];
  Vector& at(int row, int v) const { return node[row / 3][row % 3 * kStride + v]; }
};

/// Rows that lie together.
template <int kStride>
inline TileRows<kStride> find_rows(Vector* first) {
  TileRows<kStride> rows;
  for (int a = 0; a < kTileRows / 3; ++a) rows.node[a] = first + 3 * a * kStride;
  return rows;
}

/// Rows of the first `count` of some nodes. Those of the next four, which come next, are fetched meanwhile.
template <int kStride>
inline TileRows<kStride> find_rows(double* all, const int* nodes, int count) {
  TileRows<kStride> rows;
  for (int a = 0; a < kTileRows / 3; ++a)
    rows.node[a] = reinterpret_cast<Vector*>(all) + 3 * kStride * static_cast<long>(nodes[a < count ? a : 0]);
  for (int a = kTileRows / 3; a < 2 * (kTileRows / 3) && a < count; ++a) {
    const double* next = all + 24 * kStride * static_cast<long>(nodes[a]);
    for (int line = 0; line < 3 * kStride; ++line) __builtin_prefetch(next + kLine * line, 1);
  }
  return rows;
}

template <int kHeight, int kBegin, int kCount, int kUsed, int kStride, bool kSet>
inline void multiply_rows(const double* tile, int n, const Vector* in, const TileRows<kStride>& out, int first) {
  Vector sum[kCount][kUsed];
#pragma GCC unroll 12
  for (int i = 0; i < kCount; ++i)
#pragma GCC unroll 2
    for (int v = 0; v < kUsed; ++v) sum[i][v] = kSet ? Vector{} : out.at(kBegin + i, first + v);
  for (int k = 0; k < n; ++k) {
    Vector row[kUsed];
#pragma GCC unroll 2
    for (int v = 0; v < kUsed; ++v) row[v] = in[k * kStride + first + v];
    const double* a = tile + k * kHeight + kBegin;
    for (int i = 0; i < kCount; i += kLine) prefetch(a + kFar + i, a + kNear + i);
#pragma GCC unroll 12
    for (int i = 0; i < kCount; ++i)
#pragma GCC unroll 2
      for (int v = 0; v < kUsed; ++v) sum[i][v] = kSet ? sum[i][v] + row[v] * a[i] : sum[i][v] - row[v] * a[i];
  }
#pragma GCC unroll 12
  for (int i = 0; i < kCount; ++i)
#pragma GCC unroll 2
    for (int v = 0; v < kUsed; ++v) out.at(kBegin + i, first + v) = sum[i][v];
}

/// out (-= or, with kSet, =) tile in.
template <int kHeight, int kStride, bool kSet, int kBegin = 0>
inline void multiply_tile(const double* tile, int n, const Vector* in, const TileRows<kStride>& out) {
  if constexpr (kBegin < kHeight) {
    constexpr int kCount = kHeight - kBegin < kRows ? kHeight - kBegin : kRows;
    constexpr int kUsed = kStride < kVectors ? kStride : kVectors;
    for (int v = 0; v < kStride; v += kUsed) multiply_rows<kHeight, kBegin, kCount, kUsed, kStride, kSet>(tile, n, in, out, v);
    multiply_tile<kHeight, kStride, kSet, kBegin + kCount>(tile, n, in, out);
  }
}

template <int kStride>
void subtract_product(const double* tiles, int m, int n, const double* in_rows, const int* nodes, double* all) {
  const auto* in = reinterpret_cast<const Vector*>(in_rows);
  int i = 0;
  for (; i + kTileRows <= m; i += kTileRows, nodes += kTileRows / 3)
    multiply_tile<kTileRows, kStride, false>(tiles + static_cast<long>(i) * n, n, in, find_rows<kStride>(all, nodes, (m - i) / 3));
  if (i == m) return;
  tiles += static_cast<long>(i) * n;
  const auto out = find_rows<kStride>(all, nodes, (m - i) / 3);
  if (m - i == 9) multiply_tile<9, kStride, false>(tiles, n, in, out);
  if (m - i == 6) multiply_tile<6, kStride, false>(tiles, n, in, out);
  if (m - i == 3) multiply_tile<3, kStride, false>(tiles, n, in, out);
}

template <int kStride>
void trmm(const double* tiles, int n, const double* in_rows, double* out_rows) {
  const auto* in = reinterpret_cast<const Vector*>(in_rows);
  auto* out = reinterpret_cast<Vector*>(out_rows);
  int i = 0;
  for (; i + kTileRows <= n; i += kTileRows, out += kTileRows * kStride) {
    multiply_tile<kTileRows, kStride, true>(tiles, i + kTileRows, in, find_rows<kStride>(out));
    tiles += kTileRows * (i + kTileRows);
  }
  if (n - i == 9) multiply_tile<9, kStride, true>(tiles, n, in, find_rows<kStride>(out));
  if (n - i == 6) multiply_tile<6, kStride, true>(tiles, n, in, find_rows<kStride>(out));
  if (n - i == 3) multiply_tile<3, kStride, true>(tiles, n, in, find_rows<kStride>(out));
}

template <int kHeight, int kCount, int kUsed, int kStride, bool kAdd>
inline void multiply_columns(const double* tile, const Reading& reading, const TileRows<kStride>& in, int first, Vector* out) {
  const double* far = reading.find_ahead(tile, kFar);
  const double* near = reading.find_ahead(tile, kNear);
  Vector sum[kCount][kUsed];
#pragma GCC unroll 12
  for (int k = 0; k < kCount; ++k)
#pragma GCC unroll 2
    for (int v = 0; v < kUsed; ++v) sum[k][v] = out[k * kStride + first + v];
#pragma GCC unroll 12
  for (int i = 0; i < kHeight; ++i) {
#pragma GCC unroll 2
    for (int line = i * kCount / kLine; line < (i + 1) * kCount / kLine; ++line) prefetch(far + kLine * line, near + kLine * line);
    Vector row[kUsed];
#pragma GCC unroll 2
    for (int v = 0; v < kUsed; ++v) row[v] = in.at(i, first + v);
    const double* a = tile + i;
#pragma GCC unroll 12
    for (int k = 0; k < kCount; ++k)
#pragma GCC unroll 2
      for (int v = 0; v < kUsed; ++v) sum[k][v] = kAdd ? sum[k][v] + row[v] * a[k * kHeight] : sum[k][v] - row[v] * a[k * kHeight];
  }
#pragma GCC unroll 12
  for (int k = 0; k < kCount; ++k)
#pragma GCC unroll 2
    for (int v = 0; v < kUsed; ++v) out[k * kStride + first + v] = sum[k][v];
}

/// out (n rows) (-= or, with kAdd, +=) tile^T in.
template <int kHeight, int kStride, bool kAdd>
inline void multiply_tile_transposed(const double* tile, const Reading& reading, int n, const TileRows<kStride>& in, Vector* out) {
  constexpr int kUsed = kStride < kVectors ? kStride : kVectors;
  for (int v = 0; v < kStride; v += kUsed) {
    int k = 0;
    for (; k + kRows <= n; k += kRows)
      multiply_columns<kHeight, kRows, kUsed, kStride, kAdd>(tile + k * kHeight, reading, in, v, out + k * kStride);
    for (; k < n; k += 3) multiply_columns<kHeight, 3, kUsed, kStride, kAdd>(tile + k * kHeight, reading, in, v, out + k * kStride);
  }
}

template <int kStride>
void subtract_transposed(const double* tiles, int m, int n, const int* nodes, double* all, double* out_rows, const double* next) {
  auto* out = reinterpret_cast<Vector*>(out_rows);
  const Reading reading{tiles + static_cast<long>(m) * n, next};
  int i = 0;
  for (; i + kTileRows <= m; i += kTileRows, nodes += kTileRows / 3, tiles += kTileRows * n)
    multiply_tile_transposed<kTileRows, kStride, false>(tiles, reading, n, find_rows<kStride>(all, nodes, (m - i) / 3), out);
  if (i == m) return;
  const auto in = find_rows<kStride>(all, nodes, (m - i) / 3);
  if (m - i == 9) multiply_tile_transposed<9, kStride, false>(tiles, reading, n, in, out);
  if (m - i == 6) multiply_tile_transposed<6, kStride, false>(tiles, reading, n, in, out);
  if (m - i == 3) multiply_tile_transposed<3, kStride, false>(tiles, reading, n, in, out);
}

template <int kStride>
void add_trmm_transposed(const double* tiles, int n, double* in_rows, double* out_rows, const double* next) {
  auto* in = reinterpret_cast<Vector*>(in_rows);
  auto* out = reinterpret_cast<Vector*>(out_rows);
  const Reading reading{tiles + count_triangle(n), next};
  int i = 0;
  for (; i + kTileRows <= n; i += kTileRows, in += kTileRows * kStride) {
    multiply_tile_transposed<kTileRows, kStride, true>(tiles, reading, i + kTileRows, find_rows<kStride>(in), out);
    tiles += kTileRows * (i + kTileRows);
  }
  if (n - i == 9) multiply_tile_transposed<9, kStride, true>(tiles, reading, n, find_rows<kStride>(in), out);
  if (n - i == 6) multiply_tile_transposed<6, kStride, true>(tiles, reading, n, find_rows<kStride>(in), out);
  if (n - i == 3) multiply_tile_transposed<3, kStride, true>(tiles, reading, n, find_rows<kStride>(in), out);
}

void subtract_product(const double* tiles, int m, int n, int vectors, const double* in, const int* nodes, double* rows) {
  vectors == 1 ? subtract_product<1>(tiles, m, n, in, nodes, rows) : subtract_product<2>(tiles, m, n, in, nodes, rows);
}
void subtract_transposed(const double* tiles, int m, int n, int vectors, const int* nodes, double* rows, double* out, const double* next) {
  vectors == 1 ? subtract_transposed<1>(tiles, m, n, nodes, rows, out, next) : subtract_transposed<2>(tiles, m, n, nodes, rows, out, next);
}
void trmm(const double* tiles, int n, int vectors, const double* in, double* out) {
  vectors == 1 ? trmm<1>(tiles, n, in, out) : trmm<2>(tiles, n, in, out);
}
void add_trmm_transposed(const double* tiles, int n, int vectors, double* in, double* out, const double* next) {
  vectors == 1 ? add_trmm_transposed<1>(tiles, n, in, out, next) : add_trmm_transposed<2>(tiles, n, in, out, next);
}

template <int kStride>
void multiply_by_d_inverse(const double* diagonal, const double* off, int n, const double* in_rows, double* out_rows) {
  const auto* in = reinterpret_cast<const Vector*>(in_rows);
  auto* out = reinterpret_cast<Vector*>(out_rows);
  for (int k = 0; k < n; ++k, in += kStride, out += kStride)
#pragma GCC unroll 2
    for (int v = 0; v < kStride; ++v) {
      Vector row = diagonal[k] * in[v];
      if (off[k] != 0) row += off[k] * in[kStride + v];
      if (k > 0 && off[k - 1] != 0) row += off[k - 1] * in[v - kStride];
      out[v] = row;
    }
}

void multiply_by_d_inverse(const double* diagonal, const double* off, int n, int vectors, const double* in, double* out) {
  vectors == 1 ? multiply_by_d_inverse<1>(diagonal, off, n, in, out) : multiply_by_d_inverse<2>(diagonal, off, n, in, out);
}

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

typedef double UnalignedVector __attribute__((vector_size(64), aligned(8)));
constexpr int kLanes = kWideRows / 8;

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
          for (int u = 0; u < kVectors; ++u) __builtin_prefetch(columns[kBegin + i] + row + 8 * (v + u), 1);
      Vector sum[kCount][kVectors] = {};
      add_outer<kHeight, true>(tile + kBegin, strip + v, n, sum);
#pragma GCC unroll 12
      for (int i = 0; i < kCount; ++i) {
        double* target = columns[kBegin + i] + row + 8 * v;
#pragma GCC unroll 2
        for (int u = 0; u < kVectors; ++u) store_vector(target + 8 * u, is_set ? sum[i][u] : load_vector(target + 8 * u) + sum[i][u]);
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
        for (int v = 0; v < kLanes; ++v) strip[k * kLanes + v] = load_vector(columns[k] + row + 8 * v);
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

/// Four rows of four numbers.
inline void transpose_square(const double* from, long from_stride, double* to, long to_stride) {
  const Quad a = load(from), b = load(from + from_stride), c = load(from + 2 * from_stride), d = load(from + 3 * from_stride);
  const Quad ab_even = __builtin_shufflevector(a, b, 0, 4, 2, 6), ab_odd = __builtin_shufflevector(a, b, 1, 5, 3, 7);
  const Quad cd_even = __builtin_shufflevector(c, d, 0, 4, 2, 6), cd_odd = __builtin_shufflevector(c, d, 1, 5, 3, 7);
  store(to, __builtin_shufflevector(ab_even, cd_even, 0, 1, 4, 5));
  store(to + to_stride, __builtin_shufflevector(ab_odd, cd_odd, 0, 1, 4, 5));
  store(to + 2 * to_stride, __builtin_shufflevector(ab_even, cd_even, 2, 3, 6, 7));
  store(to + 3 * to_stride, __builtin_shufflevector(ab_odd, cd_odd, 2, 3, 6, 7));
}

void transpose(const double* from, long from_stride, int n, int m, double* to, long to_stride) {
  const int whole_n = n / 4 * 4;
  const int whole_m = m / 4 * 4;
  for (int j = 0; j < whole_m; j += 4)
    for (int i = 0; i < whole_n; i += 4) transpose_square(from + i * from_stride + j, from_stride, to + j * to_stride + i, to_stride);
  for (int j = 0; j < m; ++j)
    for (int i = j < whole_m ? whole_n : 0; i < n; ++i) to[j * to_stride + i] = from[i * from_stride + j];
}

}  // namespace

extern const Kernels kTable;
const Kernels kTable{subtract_product,
                     subtract_transposed,
                     trmm,
                     add_trmm_transposed,
                     multiply_by_d_inverse,
                     factorise_block,
                     trsm,
                     scale_by_d_inverse,
                     update,
                     update_columns,
                     extend_add,
                     transpose,
                     CARILLON_ISA_NAME};

}  // namespace carillon::ldlt::CARILLON_ISA
