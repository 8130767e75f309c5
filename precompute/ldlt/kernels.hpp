// Inner loops, compiled for several instruction sets; those of this processor are found at run time.
#pragma once

#include <cstdint>

namespace carillon::ldlt {

/// Rows of L stored together. A block of m rows and n columns is stored as tiles of kTileRows rows (the last may have fewer), each
/// column-major: both directions of a solve read it once, contiguously.
inline constexpr int kTileRows = 12;
/// Rows of W = L D stored together, column-major.
inline constexpr int kWideRows = 16;
/// An update matrix of r rows is stored as strips of kStripColumns columns, each with full columns from its own first row on.
inline constexpr int kStripColumns = 96;
static_assert(kStripColumns % kTileRows == 0);
/// Largest order of a diagonal block.
inline constexpr int kMaxBlock = 72;

/// Stored numbers of a lower triangle of order n: tiles as above, each up to the diagonal of its last row.
[[gnu::always_inline]] constexpr std::int64_t count_triangle(std::int64_t n) {
  const std::int64_t whole = n / kTileRows;
  const std::int64_t rest = n - whole * kTileRows;
  return kTileRows * kTileRows * (whole * (whole + 1) / 2) + rest * n;
}

/// D and the pivot order of a diagonal block B (n, n): P B P^T = L D L^T.
struct BlockPivots {
  // The inverse of D: 1x1 pivots have off[k] = 0; a 2x2 pivot at k, k + 1 has off[k] != 0 and off[k + 1] = 0.
  double diagonal[kMaxBlock];
  double off[kMaxBlock];
  int order[kMaxBlock];  // row k of P B is row order[k] of B
  int negative = 0;      // negative eigenvalues of D
  double smallest = 0;   // smallest magnitude of an eigenvalue of D (lower bound for 2x2 pivots)
};

/// Rows consecutive in both a child and its parent.
struct RowRun {
  int from = 0;
  int to = 0;
  int length = 0;
};

/// An eliminated panel of n columns, for the update of the columns behind it. Row numbers of the front.
struct Panel {
  const double* tiles = nullptr;  // L21 in tiles, from row `begin` on
  const double* wide = nullptr;   // W in strips of kWideRows rows, from row `begin` on
  int n = 0;
  int begin = 0;
};

/// Inner loops of a factorisation.
struct FactorKernels {
  /// Factorises a symmetric block, both triangles given, columns kMaxBlock apart, by rook pivoting; overwrites it and stores L^-1 in tiles
  /// (count_triangle). False if a pivot is exactly zero or not finite.
  bool (*factorise_block)(double* block, int n, BlockPivots& pivots, double* tiles);
  /// W = A P^T L^-T for rows begin to end of a front, in strips of kWideRows rows. columns: (n) address of row 0 of each column of A, in
  /// pivot order; triangle: L^-1.
  void (*trsm)(const double* const* columns, int begin, int end, int n, const double* triangle, double* wide);
  /// L = W D^-1 (m, n), strips to tiles, from row `begin` of W on, a multiple of 4. Raises growth to the largest magnitude in L.
  void (*scale_by_d_inverse)(const double* wide, int begin, int m, int n, const BlockPivots& pivots, double* tiles, double& growth);
  /// C -= L W^T (or = -L W^T if is_made, which initialises the update matrix), for columns panel.begin to end of a front with `end` rows;
  /// the first `pivots` columns, a multiple of kTileRows behind panel.begin, are stored in full and the others in strips. columns: (end)
  /// address of row 0 of each column. Entries above the diagonal become undefined.
  void (*update)(const Panel& panel, int pivots, int end, bool is_made, double* const* columns);
  /// C -= W L^T: rows begin to end of W (strips of kWideRows rows) and `width` rows of L (tiles), both with n columns. columns: (width)
  /// address of row 0 of each column of C.
  void (*update_columns)(const double* tiles, int width, const double* wide, int begin, int end, int n, double* const* columns);
  /// target[c][run.to + i] += source[c][run.from + i] for every run and three columns; in column c the first c rows of the first run are
  /// skipped.
  void (*extend_add)(const double* const* source, const RowRun* runs, int count, double* const* target);
};
const FactorKernels& find_factor_kernels();

/// Inner loops of a solve. Right-hand sides are rows of 8 * vectors numbers, aligned to 64 bytes; vectors is 1 or 2.
struct SolveKernels {
  /// X -= A in, A (m, n) in tiles; in: n rows. Affects rows 3 nodes[i], 3 nodes[i] + 1 and 3 nodes[i] + 2 of X for i < m / 3.
  void (*subtract_product)(const double* tiles, int m, int n, int vectors, const double* in, const int* nodes, double* x);
  /// out (n rows) -= A^T X. next: data read after A, which is prefetched.
  void (*subtract_transposed)(const double* tiles, int m, int n, int vectors, const int* nodes, double* x, double* out, const double* next);
  /// out (n rows) = T in, T a lower triangle in tiles.
  void (*trmm)(const double* tiles, int n, int vectors, const double* in, double* out);
  /// out (n rows) += T^T in. next: as above.
  void (*add_trmm_transposed)(const double* tiles, int n, int vectors, double* in, double* out, const double* next);
  /// out (n rows) = D^-1 in; diagonal and off: as in BlockPivots, from the first row on.
  void (*multiply_by_d_inverse)(const double* diagonal, const double* off, int n, int vectors, const double* in, double* out);
  /// to (m rows of n numbers, to_stride apart) = transpose of from (n rows of m numbers, from_stride apart). They must not overlap.
  void (*transpose)(const double* from, long from_stride, int n, int m, double* to, long to_stride);
  /// to = from and to += from, `count` numbers, a multiple of 8.
  void (*copy)(const double* from, long count, double* to);
  void (*add)(const double* from, long count, double* to);
};
const SolveKernels& find_solve_kernels();

}  // namespace carillon::ldlt
