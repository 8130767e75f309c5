// Products of tiles whose sums are in registers, for block_kernels.cpp, compiled for several instruction sets. Private header.
#pragma once

#include <cstddef>

namespace carillon::la {

inline constexpr int kMostNarrow = 32;  // maximum columns of the narrow block
inline constexpr int kTile = 4;         // columns of the narrow block in registers
inline constexpr int kMostWide = 6;     // maximum columns of the wide block in registers
inline constexpr int kSums = 8;         // partial sums of a product, over every eighth row

/// Prefetches of a tile: columns of the wide block, one strip ahead to the first-level cache and a few strips ahead to the second. The
/// first alone has too few open requests to saturate memory.
struct Prefetch {
  const double* near = nullptr;
  const double* far = nullptr;
  int columns = 0;
};

/// Columns are lda, ldb, ldc apart. rows: a multiple of kSums; b: aligned to 64 bytes.
struct BlockTiles {
  using AddTransposed = void (*)(const double* a, std::ptrdiff_t lda, const double* b, std::ptrdiff_t ldb, std::ptrdiff_t rows,
                                 double* sums, Prefetch next);
  using Subtract = void (*)(const double* a, std::ptrdiff_t lda, const double* s, std::ptrdiff_t lds, double* b, std::ptrdiff_t ldb,
                            std::ptrdiff_t rows, Prefetch next);
  using Combine = void (*)(const double* a, const double* s, int count, double* c, std::ptrdiff_t ldc, int rows, int columns);

  int narrow = -1;  // maximum columns of the narrow block: dgemm is as fast for wider ones; -1: no tiles
  int wide = 0;     // columns of the wide block in registers
  /// sums (i, kTile, kSums) += a^T b, by the number i of columns of a.
  AddTransposed add_transposed[kMostWide + 1] = {};
  /// small (wide, columns), `stride` apart, += the totals of such sums.
  void (*collect)(const double* sums, int wide, int columns, double* small, std::ptrdiff_t stride) = nullptr;
  /// b (rows, kTile) -= a s, s (i, kTile), by the number i of columns of a.
  Subtract subtract[kMostWide + 1] = {};
  int combined_rows = 0, combined_columns = 0;
  /// Null: dgemm is as fast. c (rows, columns) = a s, any part of the tile; a: packed (count, combined_rows), s: packed (count,
  /// combined_columns).
  Combine combine = nullptr;
};

const BlockTiles& find_block_tiles();

}  // namespace carillon::la
