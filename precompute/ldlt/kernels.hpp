// The inner loops, compiled for several instruction sets; the processor picks at start.
#pragma once

#include <cstdint>
#include <vector>

namespace carillon::ldlt {

/// Rows of L that lie together in memory. A block of m rows and n columns is stored as tiles of kTileRows rows (the last one may be lower),
/// each by columns: both directions of a solve then read it once from front to end.
inline constexpr int kTileRows = 12;
/// Largest order of a diagonal block.
inline constexpr int kMaxBlock = 72;

/// D and the permutation of a diagonal block B (n, n): P B P^T = L D L^T.
struct BlockPivots {
  // The inverse of D: 1x1 pivots have off[k] = 0; a 2x2 pivot at k, k + 1 has off[k] != 0 and off[k + 1] = 0.
  double diagonal[kMaxBlock];
  double off[kMaxBlock];
  int negative = 0;     // eigenvalues of D below zero
  double smallest = 0;  // least magnitude of an eigenvalue of D (of 2x2 pivots: a lower bound)
};

/// Consecutive rows of a child that stay consecutive in its parent.
struct Run {
  int from = 0;
  int to = 0;
  int length = 0;
};

/// Right-hand sides are rows of 8 * vectors numbers, aligned to 64 bytes; vectors is 1 or 2.
struct Kernels {
  /// out (m rows) -= A in (n rows); A (m, n) in tiles.
  void (*subtract_product)(const double* tiles, int m, int n, int vectors, const double* in, double* out);
  /// out (m rows) = A in.
  void (*set_product)(const double* tiles, int m, int n, int vectors, const double* in, double* out);
  /// out (n rows) -= A^T in (m rows).
  void (*subtract_transposed)(const double* tiles, int m, int n, int vectors, const double* in, double* out);
  /// out (n rows) += A^T in.
  void (*add_transposed)(const double* tiles, int m, int n, int vectors, const double* in, double* out);
  /// Factorises a symmetric block, both triangles given, columns kMaxBlock apart, by rook pivoting; replaces it by T = L^-1 P with rows
  /// kMaxBlock apart. False if a pivot vanishes exactly or is not finite.
  bool (*factorise_block)(double* block, int n, BlockPivots& pivots);
  /// L = W D^-1 (m, n): W by columns m apart, L by columns `ld` apart and again in tiles. Raises growth to the largest magnitude in L.
  void (*divide_and_pack)(const double* product, int m, int n, const BlockPivots& pivots, double* below, int ld, double* tiles,
                          double& growth);
  /// target[run.to + i] += source[run.from + i] for every run.
  void (*add_runs)(const double* source, const Run* runs, int count, double* target);
  const char* name;
};

/// Those that this processor runs, the fastest first.
std::vector<const Kernels*> list_kernels();
/// The fastest of them, unless set_kernels has chosen another (for tests; before any factorisation, on all ranks alike).
const Kernels& get_kernels();
void set_kernels(const Kernels* kernels);

}  // namespace carillon::ldlt
