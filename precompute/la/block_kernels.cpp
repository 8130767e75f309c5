// Method: The narrow block is packed in panels of rows that stay in the second-level cache; the wide block is streamed, a few columns at a
// time, in strips that stay in the first-level cache and are prefetched one strip ahead. Sums and coefficients are in registers
// (block_tiles.cpp). The wide block is not packed: it is used once, and packing halves the speed of BLAS for 16 columns
// (docs/decisions/block-lanczos.md). Where tiles are slower, BLAS on the same panels.
// Source: Goto, van de Geijn, Anatomy of high-performance matrix multiplication, ACM TOMS 34(3), 2008 (panels, register tiles).
#include "precompute/la/block_kernels.hpp"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <vector>

#include "precompute/la/block_tiles.hpp"
#include "precompute/petsc/work.hpp"

namespace carillon::la {
namespace {

constexpr std::ptrdiff_t kRowsTransposed = 4096;  // rows of a panel for A^T B: 16 columns of B are half a megabyte
constexpr std::ptrdiff_t kRowsProduct = 2048;     // rows of a panel for B - A S, which is also written
constexpr std::ptrdiff_t kStrip = 128;            // rows of a strip of these
constexpr std::ptrdiff_t kRowsFused = 2048;       // rows of a panel used by several products
constexpr std::ptrdiff_t kRowsCombined = 256;     // rows of a panel for A S

int round_up(int n, int to) { return (n + to - 1) / to * to; }

/// Tiles are faster than BLAS for a narrow block of `count` columns.
bool has_tiles(int count) { return count <= find_block_tiles().narrow; }

/// The strips of a panel in the order of use: down a group of columns, then the next group. Avoids divisions per tile.
class Strips {
 public:
  /// first, rows: of the panel; tiles: number of tiles per strip; wide: columns of a tile.
  Strips(const Columns& a, std::ptrdiff_t first, std::ptrdiff_t rows, int tiles, int wide)
      : a_(a), first_(first), rows_(rows), height_((rows + kStrip - 1) / kStrip * kStrip), tiles_(tiles), wide_(wide) {}

  /// Starts columns [i, i + wide).
  void begin_columns(int i, int wide) {
    column_ = i;
    for (int j = 0; j <= tiles_; ++j) share_[j] = j * wide / tiles_;
  }
  /// Starts row r of the panel.
  void begin_strip(std::ptrdiff_t r) {
    constexpr int kFar = 3;
    near_ = find(r + kStrip);
    far_ = find(r + kFar * kStrip);
  }
  /// Prefetch share of tile j.
  Prefetch find_prefetch(int j) const {
    const std::ptrdiff_t offset = share_[j] * a_.stride;
    return {near_ + offset, far_ + offset, share_[j + 1] - share_[j]};
  }

 private:
  const double* find(std::ptrdiff_t r) const {
    int i = column_;
    for (; r >= height_; r -= height_) i += wide_;
    if (i < a_.count) return a_.column(i) + first_ + r;
    return a_.column(0) + std::min(first_ + rows_ + r, a_.rows - 1);  // of the next panel
  }

  const Columns& a_;
  std::ptrdiff_t first_;
  std::ptrdiff_t rows_;
  std::ptrdiff_t height_;
  int tiles_;
  int wide_;
  int column_ = 0;
  int share_[kMostNarrow / kTile + 1] = {};
  const double* near_ = nullptr;
  const double* far_ = nullptr;
};

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

/// Rows of a strip as tiles read them: if not a multiple of kSums, a copy padded by zeros.
class PaddedStrip {
 public:
  /// Columns [i, i + wide), rows [first, first + rows).
  Columns find(const Columns& a, int i, int wide, std::ptrdiff_t first, std::ptrdiff_t rows) {
    if (rows % kSums == 0) return {a.column(i) + first, rows, a.stride, wide};
    const Columns padded{space_, (rows + kSums - 1) / kSums * kSums, kStrip, wide};
    for (int k = 0; k < wide; ++k) std::fill_n(std::copy_n(a.column(i + k) + first, rows, padded.column(k)), padded.rows - rows, 0.0);
    return padded;
  }

 private:
  double space_[kMostWide * kStrip];
};

/// Adds A^T P to small, P: packed rows [first, first + rows) of a narrow block.
class TransposedProducts {
 public:
  explicit TransposedProducts(int narrow) : narrow_(narrow), tiles_(round_up(narrow, kTile) / kTile), sums_(kTileSums, tiles_) {}

  void add(const Columns& a, std::ptrdiff_t first, std::ptrdiff_t rows, PackedPanel& panel, double* small, int small_stride) {
    const BlockTiles& tiles = find_block_tiles();
    Strips strips(a, first, rows, tiles_, tiles.wide);
    PaddedStrip padded;
    for (int i = 0; i < a.count; i += tiles.wide) {
      const int wide = std::min(tiles.wide, a.count - i);
      strips.begin_columns(i, wide);
      std::fill_n(sums_.get(), static_cast<std::ptrdiff_t>(tiles_) * kTileSums, 0.0);
      for (std::ptrdiff_t r = 0; r < rows; r += kStrip) {
        const Columns strip = padded.find(a, i, wide, first + r, std::min(kStrip, rows - r));
        strips.begin_strip(r);
        for (int j = 0; j < tiles_; ++j) {
          tiles.add_transposed[wide](strip.values, strip.stride, panel.get() + j * kTile * panel.stride() + r, panel.stride(), strip.rows,
                                     sums_.get() + j * kTileSums, strips.find_prefetch(j));
        }
      }
      for (int j = 0; j < tiles_; ++j)
        tiles.collect(sums_.get() + j * kTileSums, wide, std::min(kTile, narrow_ - j * kTile),
                      small + static_cast<std::ptrdiff_t>(j) * kTile * small_stride + i, small_stride);
    }
  }

 private:
  static constexpr int kTileSums = kSums * kMostWide * kTile;
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
  const BlockTiles& tiles = find_block_tiles();
  const int across = round_up(narrow, kTile) / kTile;
  Strips strips(a, first, rows, across, tiles.wide);
  PaddedStrip padded;
  for (int i = 0; i < a.count; i += tiles.wide) {
    const int wide = std::min(tiles.wide, a.count - i);
    strips.begin_columns(i, wide);
    for (std::ptrdiff_t r = 0; r < rows; r += kStrip) {
      const Columns strip = padded.find(a, i, wide, first + r, std::min(kStrip, rows - r));
      strips.begin_strip(r);
      for (int j = 0; j < across; ++j) {
        tiles.subtract[wide](strip.values, strip.stride, s.column(j * kTile) + i, s.rows(), panel.get() + j * kTile * panel.stride() + r,
                             panel.stride(), strip.rows, strips.find_prefetch(j));
      }
    }
  }
}

void multiply_transposed_in_tiles(const Columns& a, const Columns& b, double* small, int small_stride) {
  for (int j = 0; j < b.count; ++j) std::fill_n(small + static_cast<std::ptrdiff_t>(j) * small_stride, a.count, 0.0);
  PackedPanel panel(kRowsTransposed, b.count);
  TransposedProducts products(b.count);
  for (std::ptrdiff_t first = 0; first < a.rows; first += kRowsTransposed) {
    const std::ptrdiff_t rows = std::min(kRowsTransposed, a.rows - first);
    panel.load(b, first, rows);
    products.add(a, first, rows, panel, small, small_stride);
  }
}

void subtract_product_in_tiles(const Columns& a, const double* small, int small_stride, const Columns& b) {
  const PackedCoefficients s(small, small_stride, a.count, b.count);
  PackedPanel panel(kRowsProduct, b.count);
  for (std::ptrdiff_t first = 0; first < a.rows; first += kRowsProduct) {
    const std::ptrdiff_t rows = std::min(kRowsProduct, a.rows - first);
    panel.load(b, first, rows);
    subtract_from_panel(a, s, first, rows, b.count, panel);
    panel.store(b, first, rows);
  }
}

void subtract_and_multiply_transposed_in_tiles(const Product& product, int s_stride, const double* d, const Columns& b,
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

void subtract_and_combine_in_tiles(std::span<const Product> products, int s_stride, const double* t, const double* d, const Columns& b,
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

void combine_in_tiles(const Columns& a, const double* small, int kept) {
  constexpr int kStripTiles = 4;  // row tiles that share a packed tile of S in the first-level cache
  const BlockTiles& tiles = find_block_tiles();
  const std::ptrdiff_t tile_rows = tiles.combined_rows, wide = tiles.combined_columns, count = a.count;
  const std::ptrdiff_t groups = (kept + wide - 1) / wide;
  std::vector<double> packed(static_cast<std::size_t>(groups * count * wide), 0.0);
  for (int j = 0; j < kept; ++j) {
    double* to = packed.data() + (j / wide) * count * wide + j % wide;
    for (std::ptrdiff_t k = 0; k < count; ++k) to[k * wide] = small[j * count + k];
  }
  std::vector<double> panel(static_cast<std::size_t>(kStripTiles * tile_rows * count), 0.0);
  for (std::ptrdiff_t first = 0; first < a.rows; first += kStripTiles * tile_rows) {
    const std::ptrdiff_t rows = std::min(kStripTiles * tile_rows, a.rows - first);
    for (std::ptrdiff_t k = 0; k < count; ++k) {
      const double* from = a.values + k * a.stride + first;
      for (std::ptrdiff_t r = 0; r < rows; r += tile_rows)
        std::copy_n(from + r, std::min(tile_rows, rows - r), panel.data() + r * count + k * tile_rows);
    }
    for (std::ptrdiff_t g = 0; g < groups; ++g)
      for (std::ptrdiff_t r = 0; r < rows; r += tile_rows)
        tiles.combine(panel.data() + r * count, packed.data() + g * count * wide, a.count, a.column(static_cast<int>(g * wide)) + first + r,
                      a.stride, static_cast<int>(std::min(tile_rows, rows - r)), static_cast<int>(std::min(wide, kept - g * wide)));
  }
}

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
  if (has_tiles(b.count)) return multiply_transposed_in_tiles(a, b, small, small_stride);
  if (has_tiles(a.count)) {  // Transposed product with exchanged operands.
    Matrix turned(b.count, a.count);
    multiply_transposed_in_tiles(b, a, turned.data(), b.count);
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
  if (has_tiles(b.count)) return subtract_product_in_tiles(a, small, small_stride, b);
  subtract_by_blas(a, small, small_stride, b);
}

void subtract_and_multiply_transposed(const Product& product, int s_stride, const double* d, const Columns& b, std::span<const Columns> c,
                                      double* small, int small_stride) {
  int all = product.a.count;
  for (const Columns& set : c) all += set.count;
  petsc::add_flops(2.0 * static_cast<double>(b.rows) * all * b.count);
  for (int j = 0; j < b.count; ++j) std::fill_n(small + static_cast<std::ptrdiff_t>(j) * small_stride, all - product.a.count, 0.0);
  if (has_tiles(b.count)) return subtract_and_multiply_transposed_in_tiles(product, s_stride, d, b, c, small, small_stride);
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
  if (has_tiles(b.count)) return subtract_and_combine_in_tiles(products, s_stride, t, d, b, z);
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
  if (find_block_tiles().combine != nullptr) return combine_in_tiles(a, small, kept);
  std::vector<double> panel(static_cast<std::size_t>(kRowsCombined) * static_cast<std::size_t>(a.count));
  for (std::ptrdiff_t first = 0; first < a.rows; first += kRowsCombined) {
    const std::ptrdiff_t rows = std::min(kRowsCombined, a.rows - first);
    for (int j = 0; j < a.count; ++j) std::copy_n(a.column(j) + first, rows, panel.data() + j * kRowsCombined);
    gemm(Transpose::kNo, rows, kept, a.count, 1.0, panel.data(), kRowsCombined, small, a.count, 0.0, a.values + first, a.stride);
  }
}

}  // namespace carillon::la
