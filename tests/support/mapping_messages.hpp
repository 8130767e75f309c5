// Messages of a mapping of fronts to ranks, counted by tiles as the factorisation and its solves send them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "precompute/ldlt/kernels.hpp"
#include "precompute/ldlt/mapping.hpp"
#include "precompute/ldlt/tile_map.hpp"

namespace carillon::tests {

inline constexpr double kSolveColumns = 16;

/// Of contribution blocks and sums sent from a child to its parent, message counts are upper bounds, one per pair of ranks, and bytes
/// assume even shares.
struct MappingMessages {
  std::vector<double> messages;          // (ranks) received in a factorisation
  std::vector<double> bytes;             // (ranks) received in a factorisation
  std::vector<double> solve_messages;    // (ranks) received in a solve of up to 32 columns, forward and backward
  std::vector<double> solve_bytes;       // (ranks) the same for kSolveColumns
  double solve_path_messages = 0;        // sequential messages on the longest path from a leaf to the root and back
  std::int32_t most_planned_fronts = 0;  // shared fronts in the plan of one rank: from its subtrees to the root, and their children
};

/// Counts the messages between the ranks of a shared front.
class FrontMessages {
 public:
  FrontMessages(const ldlt::TileMap& map, MappingMessages& counts) : map_(map), counts_(counts) {}

  void count() {
    for (int k = 0; k < map_.pivot_tiles(); ++k) {
      const double n = 3.0 * map_.nodes(k);
      const int home = map_.owner(k, k);
      for (const int place : map_.list_column(k)) {
        receive(place, 3 * n + static_cast<double>(ldlt::count_triangle(static_cast<std::int64_t>(n))));
        solve(place, n);  // forward: solution at the panel
        solve(home, n);   // backward: a sum
        send_rows(k, place);
      }
      send_rows(k, home);
      for (const int place : map_.list_row(k)) {
        solve(home, n);
        solve(place, n);
      }
    }
  }

 private:
  /// Sends each place with tiles behind the panel the rows that it needs for its rows or columns.
  void send_rows(int k, int from) {
    const double n = 3.0 * map_.nodes(k);
    for (int to = 0; to < map_.places(); ++to) {
      if (to == from || map_.find_last_column(to) <= k) continue;
      double rows = 0;
      map_.for_needed(k, from, to, [&](int i) { rows += 3.0 * map_.nodes(i); });
      if (rows > 0) receive(to, n * (rows + 2));
    }
  }
  void receive(int place, double numbers) {
    counts_.messages[map_.rank(place)] += 1;
    counts_.bytes[map_.rank(place)] += 8 * numbers;
  }
  void solve(int place, double rows) {
    counts_.solve_messages[map_.rank(place)] += 1;
    counts_.solve_bytes[map_.rank(place)] += 8 * kSolveColumns * rows;
  }

  const ldlt::TileMap& map_;
  MappingMessages& counts_;
};

inline MappingMessages count_messages(const std::vector<ldlt::FrontCost>& fronts, const ldlt::Mapping& mapping) {
  MappingMessages counts;
  const std::size_t ranks = mapping.ranks();
  for (std::vector<double>* list : {&counts.messages, &counts.bytes, &counts.solve_messages, &counts.solve_bytes}) list->assign(ranks, 0.0);
  std::vector<std::int32_t> planned(ranks, 0);
  std::vector<double> path(fronts.size(), 0.0);  // messages of a solve between the leaves and this front, both ways
  std::vector<std::int32_t> roots;
  const std::vector<std::vector<std::int32_t>> children = ldlt::list_children(fronts, roots);
  for (std::size_t s = 0; s < fronts.size(); ++s) {
    const auto front = static_cast<std::int32_t>(s);
    if (mapping.owner(front) >= 0) continue;
    const std::vector<ldlt::FrontShare> shares = mapping.list_shares(front);
    const ldlt::TileMap map(fronts[s].width, fronts[s].rows, shares);
    FrontMessages(map, counts).count();
    for (const ldlt::FrontShare& share : shares) planned[share.rank] += 1 + static_cast<std::int32_t>(children[s].size());
    for (const std::int32_t child : children[s]) {
      const auto rows = 3.0 * static_cast<double>(fronts[child].rows);
      const std::vector<ldlt::FrontShare> from = mapping.list_shares(child);
      const double copies = std::ceil(std::sqrt(static_cast<double>(from.size())));  // ranks that hold a partial sum of a row
      path[s] = std::max(path[s], path[child]);
      for (const ldlt::FrontShare& share : shares) {
        const std::size_t rank = share.rank;
        for (const ldlt::FrontShare& sender : from) {
          if (sender.rank == share.rank) continue;
          const double part = share.fraction * sender.fraction;
          counts.messages[rank] += 1;
          counts.bytes[rank] += 8 * rows * (rows + 1) / 2 * part;
          counts.solve_messages[rank] += 1;
          counts.solve_bytes[rank] += 8 * kSolveColumns * rows * copies * part;
          counts.solve_messages[sender.rank] += 1;
          counts.solve_bytes[sender.rank] += 8 * kSolveColumns * rows * copies * part;
        }
      }
    }
    path[s] += 2 + 4.0 * map.pivot_tiles();  // from and to the children, and at each panel along its row and its column
    counts.solve_path_messages = std::max(counts.solve_path_messages, path[s]);
  }
  for (const std::int32_t known : planned) counts.most_planned_fronts = std::max(counts.most_planned_fronts, known);
  return counts;
}

}  // namespace carillon::tests
