// Distribution of the tiles of a shared front.
#pragma once

#include <cstdint>
#include <vector>

#include "precompute/ldlt/mapping.hpp"

namespace carillon::ldlt {

/// The lower triangle of a front in square tiles of at most 24 nodes, distributed in two dimensions: each tile column belongs to a class of
/// ranks, and within a class each tile row to one rank. So with g ranks, a column and a row are spread over about sqrt(g) ranks each. Both
/// sides of a message compute the map independently. Ranks are identified by their place in the list of shares.
class TileMap {
 public:
  /// width, rows: pivot nodes and nodes behind them. The work of a rank follows its share as closely as tiles allow.
  TileMap(std::int32_t width, std::int32_t rows, const std::vector<FrontShare>& shares);

  int tiles() const { return static_cast<int>(starts_.size()) - 1; }
  int pivot_tiles() const { return pivot_tiles_; }
  /// First node of tile i; start(tiles()) is the number of nodes.
  std::int32_t start(int i) const { return starts_[i]; }
  std::int32_t nodes(int i) const { return start(i + 1) - start(i); }
  /// Tile of a node.
  int find_tile(std::int32_t node) const;

  int places() const { return static_cast<int>(ranks_.size()); }
  int rank(int place) const { return ranks_[place]; }
  /// -1: the rank has no share.
  int find_place(int rank) const;
  /// Place that has tile (i, j), i >= j.
  int owner(int i, int j) const { return row_owner_[class_of_column_[j]][i]; }
  /// True if column j can hold tiles of a place: a place has tiles in the columns of one class only.
  bool has_column(int place, int j) const { return class_of_place_[place] == class_of_column_[j]; }
  /// True if the place has row i in its columns.
  bool has_row(int place, int i) const { return row_owner_[class_of_place_[place]][i] == place; }
  /// True if each column is on a single place.
  bool has_whole_columns() const { return row_owner_.size() == ranks_.size(); }
  /// Last column in which a place has a tile, -1: none.
  int find_last_column(int place) const;
  /// Places, except that of the diagonal tile, with tiles in row k before the diagonal, and in column k behind it; those with a tile near
  /// the diagonal first, as the next panels wait for them.
  std::vector<int> list_row(int k) const;
  std::vector<int> list_column(int k) const;
  /// Calls visit(i) for the tiles of column k below the diagonal that are on place `from` and needed by place `to` for its updates, as rows
  /// or as columns.
  template <typename Visit>
  void for_needed(int k, int from, int to, Visit&& visit) const {
    for (int i = k + 1; i < tiles(); ++i)
      if (owner(i, k) == from && (has_row(to, i) || has_column(to, i))) visit(i);
  }
  /// Place that collects the partial sums of row i of a right-hand side: that of the diagonal tile; for rows behind the pivots, that of the
  /// last pivot column.
  int home(int i) const { return i < pivot_tiles_ ? owner(i, i) : owner(i, pivot_tiles_ - 1); }

  /// Operations of a factorisation and entries of L and D, per place.
  std::vector<double> count_operations() const;
  std::vector<std::int64_t> count_entries() const;
  /// Stored numbers of a place's tiles in the columns from `first` on.
  std::int64_t count_numbers(int place, int first = 0) const;

 private:
  double cost(int i, int j) const;
  std::vector<int> list_others(const std::vector<int>& places, int k) const;

  std::vector<std::int32_t> starts_;  // (tiles + 1)
  int pivot_tiles_ = 0;
  std::vector<int> ranks_;                   // (places)
  std::vector<int> class_of_place_;          // (places)
  std::vector<int> class_of_column_;         // (tiles)
  std::vector<std::vector<int>> row_owner_;  // (classes) of (tiles): a place
};

}  // namespace carillon::ldlt
