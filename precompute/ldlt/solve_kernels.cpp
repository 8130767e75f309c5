// Method:     Products of tiles with up to 16 right-hand sides keep a tile's sums in registers; every number of L is read once, in order,
//             and multiplied into whole vectors.
// Source:     Goto and van de Geijn 2008, Anatomy of high-performance matrix multiplication.
#include <cstring>

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
constexpr int kOne = 8 / kWidth, kTwo = 2 * kOne;  // kStride, vectors in a row, of one and of two vectors of right-hand sides

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
    const double* next = all + 3 * kStride * kWidth * static_cast<long>(nodes[a]);
    for (int line = 0; line < 3 * kStride * kWidth / kLine; ++line) __builtin_prefetch(next + kLine * line, 1);
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
  vectors == 1 ? subtract_product<kOne>(tiles, m, n, in, nodes, rows) : subtract_product<kTwo>(tiles, m, n, in, nodes, rows);
}
void subtract_transposed(const double* tiles, int m, int n, int vectors, const int* nodes, double* rows, double* out, const double* next) {
  vectors == 1 ? subtract_transposed<kOne>(tiles, m, n, nodes, rows, out, next)
               : subtract_transposed<kTwo>(tiles, m, n, nodes, rows, out, next);
}
void trmm(const double* tiles, int n, int vectors, const double* in, double* out) {
  vectors == 1 ? trmm<kOne>(tiles, n, in, out) : trmm<kTwo>(tiles, n, in, out);
}
void add_trmm_transposed(const double* tiles, int n, int vectors, double* in, double* out, const double* next) {
  vectors == 1 ? add_trmm_transposed<kOne>(tiles, n, in, out, next) : add_trmm_transposed<kTwo>(tiles, n, in, out, next);
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
  vectors == 1 ? multiply_by_d_inverse<kOne>(diagonal, off, n, in, out) : multiply_by_d_inverse<kTwo>(diagonal, off, n, in, out);
}

typedef double Quad __attribute__((vector_size(32)));
typedef double UnalignedQuad __attribute__((vector_size(32), aligned(8)));

inline Quad load(const double* from) { return *reinterpret_cast<const UnalignedQuad*>(from); }
inline void store(double* to, Quad value) { *reinterpret_cast<UnalignedQuad*>(to) = value; }

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

void copy(const double* from, long count, double* to) { std::memcpy(to, from, static_cast<std::size_t>(count) * sizeof(double)); }

void add(const double* from, long count, double* to) {
  for (long i = 0; i < count; i += 4) store(to + i, load(to + i) + load(from + i));
}

const SolveKernels kTable{subtract_product, subtract_transposed, trmm, add_trmm_transposed, multiply_by_d_inverse, transpose, copy, add};

const SolveKernels& get_kernels() { return kTable; }

}  // namespace
}  // namespace carillon::ldlt::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace carillon::ldlt {

HWY_EXPORT(get_kernels);

const SolveKernels& find_solve_kernels() { return base::choose(HWY_DISPATCH_TABLE(get_kernels))(); }

}  // namespace carillon::ldlt
#endif
