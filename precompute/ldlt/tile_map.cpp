// Method: Classes of about sqrt(g) ranks each. Columns are assigned to classes in turn, each to the class with the least resulting load
// relative to its share, so that at every panel the remaining columns are nearly balanced; rows within a class the same way. Costs are the
// operations of the tiles. With equal shares this is the block-cyclic distribution.
// Source: Gupta, Karypis, Kumar 1997, Highly scalable parallel algorithms for sparse matrix factorization (fronts in two dimensions).
#include "precompute/ldlt/tile_map.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "precompute/ldlt/storage.hpp"

namespace carillon::ldlt {
namespace {

/// Member with the least load relative to its weight after adding `cost`.
int choose(const std::vector<double>& load, const std::vector<double>& weight, double cost) {
  int best = 0;
  double least = 0;
  for (std::size_t m = 0; m < load.size(); ++m) {
    const double after = (load[m] + cost) / std::max(weight[m], 1e-12);
    if (m > 0 && after >= least) continue;
    best = static_cast<int>(m);
    least = after;
  }
  return best;
}

}  // namespace

TileMap::TileMap(std::int32_t width, std::int32_t rows, const std::vector<FrontShare>& shares) : pivot_tiles_(count_panels(width)) {
  for (int p = 0; p < pivot_tiles_; ++p) starts_.push_back(find_panel_start(width, p));
  for (std::int32_t row = 0; row < rows; row += kPanelNodes) starts_.push_back(width + row);
  starts_.push_back(width + rows);
  for (const FrontShare& share : shares) ranks_.push_back(share.rank);
  const auto group = shares.size();
  const auto in_class = group < 4 ? 1 : static_cast<std::size_t>(std::sqrt(static_cast<double>(group)));
  const std::size_t classes = (group + in_class - 1) / in_class;
  std::vector<std::vector<int>> members(classes);
  std::vector<double> class_weight(classes, 0.0);
  for (std::size_t g = 0; g < group; ++g) {
    const std::size_t c = g * classes / group;
    class_of_place_.push_back(static_cast<int>(c));
    members[c].push_back(static_cast<int>(g));
    class_weight[c] += shares[g].fraction;
  }
  const std::size_t count = tiles();
  std::vector<double> load(classes, 0.0);
  for (int j = 0; j < tiles(); ++j) {
    const double below = start(tiles()) - start(j);
    const double column = cost(j, j) * below / std::max(nodes(j), 1);
    class_of_column_.push_back(choose(load, class_weight, column));
    load[class_of_column_.back()] += column;
  }
  row_owner_.assign(classes, std::vector<int>(count, 0));
  for (std::size_t c = 0; c < classes; ++c) {
    std::vector<double> weight;
    for (const int m : members[c]) weight.push_back(shares[m].fraction);
    std::vector<double> row_load(members[c].size(), 0.0);
    double columns = 0;  // cost of a row of one node in the columns so far
    for (int i = 0; i < tiles(); ++i) {
      if (class_of_column_[i] == static_cast<int>(c)) columns += cost(i, i) / std::max(nodes(i), 1);
      const double row = columns * nodes(i);
      const int m = choose(row_load, weight, row);
      row_load[m] += row;
      row_owner_[c][i] = members[c][m];
    }
  }
}

double TileMap::cost(int i, int j) const {
  const double eliminated = 3.0 * start(std::min(j, pivot_tiles_));
  const double inside = j < pivot_tiles_ ? 3.0 * nodes(j) : 0;
  return 3.0 * nodes(i) * 3.0 * nodes(j) * (2 * eliminated + inside);
}

int TileMap::find_tile(std::int32_t node) const {
  return static_cast<int>(std::upper_bound(starts_.begin(), starts_.end() - 1, node) - starts_.begin()) - 1;
}

int TileMap::find_place(int rank) const {
  const auto at = std::lower_bound(ranks_.begin(), ranks_.end(), rank);
  return at != ranks_.end() && *at == rank ? static_cast<int>(at - ranks_.begin()) : -1;
}

int TileMap::find_last_column(int place) const {
  int last_row = tiles() - 1;
  while (last_row >= 0 && !has_row(place, last_row)) --last_row;
  int column = last_row;
  while (column >= 0 && !has_column(place, column)) --column;
  return column;
}

std::vector<int> TileMap::list_others(const std::vector<int>& places, int k) const {
  std::vector<int> others;
  for (const int place : places)
    if (place != owner(k, k) && std::find(others.begin(), others.end(), place) == others.end()) others.push_back(place);
  return others;
}

std::vector<int> TileMap::list_row(int k) const {
  std::vector<int> places;
  for (int j = k; j-- > 0;) places.push_back(owner(k, j));
  return list_others(places, k);
}

std::vector<int> TileMap::list_column(int k) const {
  std::vector<int> places;
  for (int i = k + 1; i < tiles(); ++i) places.push_back(owner(i, k));
  return list_others(places, k);
}

std::vector<double> TileMap::count_operations() const {
  std::vector<double> operations(ranks_.size(), 0.0);
  for (int j = 0; j < tiles(); ++j) {
    const double w = 3.0 * nodes(j);
    const double inside = j < pivot_tiles_ ? w * w * w / 3 : 0;
    operations[owner(j, j)] += inside + w * w * 3.0 * start(std::min(j, pivot_tiles_));
    for (int i = j + 1; i < tiles(); ++i) operations[owner(i, j)] += cost(i, j);
  }
  return operations;
}

std::vector<std::int64_t> TileMap::count_entries() const {
  std::vector<std::int64_t> entries(ranks_.size(), 0);
  for (int j = 0; j < pivot_tiles_; ++j) {
    const std::int64_t w = 3 * std::int64_t{nodes(j)};
    entries[owner(j, j)] += w * (w + 1) / 2;
    for (int i = j + 1; i < tiles(); ++i) entries[owner(i, j)] += w * 3 * nodes(i);
  }
  return entries;
}

std::int64_t TileMap::count_numbers(int place, int first) const {
  std::int64_t numbers = 0;
  for (int j = first; j < tiles(); ++j)
    for (int i = j; has_column(place, j) && i < tiles(); ++i)
      if (has_row(place, i)) numbers += 9 * std::int64_t{nodes(i)} * nodes(j);
  return numbers;
}

}  // namespace carillon::ldlt
