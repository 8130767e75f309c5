// Method:     Products of tiles with up to 16 right-hand sides keep a tile's sums in registers; every number of L is read once, in order,
// and
//             multiplied into whole vectors. Diagonal blocks: right-looking L D L^T with rook pivoting on the full square in the
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

/// Numbers of L to call from memory ahead of their use: the order of use inside a tile is not what the processor foresees.
constexpr int kAhead = 1024;
constexpr int kLine = 8;

template <int kHeight, int kBegin, int kCount, int kUsed, int kStride, bool kSet>
inline void multiply_rows(const double* tile, int n, const Vector* in, Vector* out) {
  Vector sum[kCount][kUsed];
  for (int i = 0; i < kCount; ++i)
    for (int v = 0; v < kUsed; ++v) sum[i][v] = kSet ? Vector{} : out[(kBegin + i) * kStride + v];
  for (int k = 0; k < n; ++k) {
    Vector row[kUsed];
    for (int v = 0; v < kUsed; ++v) row[v] = in[k * kStride + v];
    const double* a = tile + k * kHeight + kBegin;
    for (int i = 0; i < kCount; i += kLine) __builtin_prefetch(a + kAhead + i);
    for (int i = 0; i < kCount; ++i)
      for (int v = 0; v < kUsed; ++v) sum[i][v] = kSet ? sum[i][v] + row[v] * a[i] : sum[i][v] - row[v] * a[i];
  }
  for (int i = 0; i < kCount; ++i)
    for (int v = 0; v < kUsed; ++v) out[(kBegin + i) * kStride + v] = sum[i][v];
}

template <int kHeight, int kStride, bool kSet, int kBegin = 0>
inline void multiply_tile(const double* tile, int n, const Vector* in, Vector* out) {
  if constexpr (kBegin < kHeight) {
    constexpr int kCount = kHeight - kBegin < kRows ? kHeight - kBegin : kRows;
    constexpr int kUsed = kStride < kVectors ? kStride : kVectors;
    for (int v = 0; v < kStride; v += kUsed) multiply_rows<kHeight, kBegin, kCount, kUsed, kStride, kSet>(tile, n, in + v, out + v);
    multiply_tile<kHeight, kStride, kSet, kBegin + kCount>(tile, n, in, out);
  }
}

template <int kStride, bool kSet>
void multiply(const double* tiles, int m, int n, const double* in_rows, double* out_rows) {
  const auto* in = reinterpret_cast<const Vector*>(in_rows);
  auto* out = reinterpret_cast<Vector*>(out_rows);
  int i = 0;
  for (; i + kTileRows <= m; i += kTileRows)
    multiply_tile<kTileRows, kStride, kSet>(tiles + static_cast<long>(i) * n, n, in, out + i * kStride);
  tiles += static_cast<long>(i) * n;
  out += i * kStride;
  if (m - i == 9) multiply_tile<9, kStride, kSet>(tiles, n, in, out);
  if (m - i == 6) multiply_tile<6, kStride, kSet>(tiles, n, in, out);
  if (m - i == 3) multiply_tile<3, kStride, kSet>(tiles, n, in, out);
}

template <int kHeight, int kCount, int kUsed, int kStride, bool kAdd>
inline void multiply_columns(const double* tile, const Vector* in, Vector* out) {
  Vector sum[kCount][kUsed];
  for (int k = 0; k < kCount; ++k)
    for (int v = 0; v < kUsed; ++v) sum[k][v] = out[k * kStride + v];
  for (int i = 0; i < kHeight * kCount; i += kLine) __builtin_prefetch(tile + kAhead + i);
  for (int i = 0; i < kHeight; ++i) {
    Vector row[kUsed];
    for (int v = 0; v < kUsed; ++v) row[v] = in[i * kStride + v];
    const double* a = tile + i;
    for (int k = 0; k < kCount; ++k)
      for (int v = 0; v < kUsed; ++v) sum[k][v] = kAdd ? sum[k][v] + row[v] * a[k * kHeight] : sum[k][v] - row[v] * a[k * kHeight];
  }
  for (int k = 0; k < kCount; ++k)
    for (int v = 0; v < kUsed; ++v) out[k * kStride + v] = sum[k][v];
}

template <int kHeight, int kStride, bool kAdd>
inline void multiply_tile_transposed(const double* tile, int n, const Vector* in, Vector* out) {
  constexpr int kUsed = kStride < kVectors ? kStride : kVectors;
  for (int v = 0; v < kStride; v += kUsed) {
    int k = 0;
    for (; k + kRows <= n; k += kRows)
      multiply_columns<kHeight, kRows, kUsed, kStride, kAdd>(tile + k * kHeight, in + v, out + k * kStride + v);
    for (; k < n; k += 3) multiply_columns<kHeight, 3, kUsed, kStride, kAdd>(tile + k * kHeight, in + v, out + k * kStride + v);
  }
}

template <int kStride, bool kAdd>
void multiply_transposed(const double* tiles, int m, int n, const double* in_rows, double* out_rows) {
  const auto* in = reinterpret_cast<const Vector*>(in_rows);
  auto* out = reinterpret_cast<Vector*>(out_rows);
  int i = 0;
  for (; i + kTileRows <= m; i += kTileRows)
    multiply_tile_transposed<kTileRows, kStride, kAdd>(tiles + static_cast<long>(i) * n, n, in + i * kStride, out);
  tiles += static_cast<long>(i) * n;
  in += i * kStride;
  if (m - i == 9) multiply_tile_transposed<9, kStride, kAdd>(tiles, n, in, out);
  if (m - i == 6) multiply_tile_transposed<6, kStride, kAdd>(tiles, n, in, out);
  if (m - i == 3) multiply_tile_transposed<3, kStride, kAdd>(tiles, n, in, out);
}

void subtract_product(const double* tiles, int m, int n, int vectors, const double* in, double* out) {
  vectors == 1 ? multiply<1, false>(tiles, m, n, in, out) : multiply<2, false>(tiles, m, n, in, out);
}
void set_product(const double* tiles, int m, int n, int vectors, const double* in, double* out) {
  vectors == 1 ? multiply<1, true>(tiles, m, n, in, out) : multiply<2, true>(tiles, m, n, in, out);
}
void subtract_transposed(const double* tiles, int m, int n, int vectors, const double* in, double* out) {
  vectors == 1 ? multiply_transposed<1, false>(tiles, m, n, in, out) : multiply_transposed<2, false>(tiles, m, n, in, out);
}
void add_transposed(const double* tiles, int m, int n, int vectors, const double* in, double* out) {
  vectors == 1 ? multiply_transposed<1, true>(tiles, m, n, in, out) : multiply_transposed<2, true>(tiles, m, n, in, out);
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

/// T = L^-1 P by rows: row i is e_i less multiples of the rows before.
inline void invert_block(double* block, int n, const int* order) {
  alignas(64) static thread_local double inverse[kMaxBlock * kMaxBlock];
  for (int i = 0; i < n; ++i) {
    double* row = inverse + i * kMaxBlock;
    for (int j = 0; j < n; ++j) row[j] = 0;
    row[i] = 1;
    for (int k = 0; k < i; ++k) {
      const double factor = block[k * kMaxBlock + i];
      const double* above = inverse + k * kMaxBlock;
      for (int j = 0; j <= k; ++j) row[j] -= factor * above[j];
    }
  }
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < n; ++k) block[i * kMaxBlock + order[k]] = inverse[i * kMaxBlock + k];
}

bool factorise_block(double* block, int n, BlockPivots& pivots) {
  int order[kMaxBlock];
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
  invert_block(block, n, order);
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

/// One tile of full height, column after column.
inline void divide_tile(const double* product, int m, int n, const BlockPivots& pivots, double* below, int ld, double* tile,
                        Quad& largest) {
  constexpr int kParts = kTileRows / 4;
  for (int k = 0; k < n; ++k) {
    const double* w = product + static_cast<long>(k) * m;
    const double diagonal = pivots.diagonal[k];
    Quad value[kParts];
    for (int q = 0; q < kParts; ++q) value[q] = load(w + 4 * q) * diagonal;
    if (pivots.off[k] != 0)
      for (int q = 0; q < kParts; ++q) value[q] += load(w + m + 4 * q) * pivots.off[k];
    if (k > 0 && pivots.off[k - 1] != 0)
      for (int q = 0; q < kParts; ++q) value[q] += load(w - m + 4 * q) * pivots.off[k - 1];
    for (int q = 0; q < kParts; ++q) {
      largest = find_larger(largest, value[q]);
      store(below + static_cast<long>(k) * ld + 4 * q, value[q]);
      store(tile + k * kTileRows + 4 * q, value[q]);
    }
  }
}

void divide_and_pack(const double* product, int m, int n, const BlockPivots& pivots, double* below, int ld, double* tiles, double& growth) {
  Quad largest{};
  int i = 0;
  for (; i + kTileRows <= m; i += kTileRows, tiles += kTileRows * n) divide_tile(product + i, m, n, pivots, below + i, ld, tiles, largest);
  for (int q = 0; q < 4; ++q) growth = largest[q] > growth ? largest[q] : growth;
  const int height = m - i;
  for (int k = 0; k < n; ++k)
    for (int r = i; r < m; ++r) {
      const double* w = product + static_cast<long>(k) * m + r;
      double value = w[0] * pivots.diagonal[k];
      if (pivots.off[k] != 0) value += w[m] * pivots.off[k];
      if (k > 0 && pivots.off[k - 1] != 0) value += w[-m] * pivots.off[k - 1];
      growth = magnitude(value) > growth ? magnitude(value) : growth;
      below[static_cast<long>(k) * ld + r] = value;
      tiles[k * height + r - i] = value;
    }
}

void add_runs(const double* source, const Run* runs, int count, double* target) {
  for (int k = 0; k < count; ++k) {
    const double* __restrict__ from = source + runs[k].from;
    double* __restrict__ to = target + runs[k].to;
    const int length = runs[k].length;
    for (int i = 0; i < length; ++i) to[i] += from[i];
  }
}

}  // namespace

extern const Kernels kTable;
const Kernels kTable{subtract_product, set_product, subtract_transposed, add_transposed, factorise_block,
                     divide_and_pack,  add_runs,    CARILLON_ISA_NAME};

}  // namespace carillon::ldlt::CARILLON_ISA
