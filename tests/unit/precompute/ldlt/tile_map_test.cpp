#include "precompute/ldlt/tile_map.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <set>
#include <utility>

#include "precompute/ldlt/kernels.hpp"
#include "precompute/ldlt/plan.hpp"
#include "precompute/ldlt/symbolic.hpp"

namespace carillon::ldlt {
namespace {

std::vector<FrontShare> make_equal(int ranks) {
  std::vector<FrontShare> shares;
  for (int rank = 0; rank < ranks; ++rank) shares.push_back({rank, 1.0 / ranks});
  return shares;
}

TEST(TileMap, every_node_is_in_one_tile_and_every_tile_has_one_owner) {
  for (const std::int32_t width : {1, 23, 24, 25, 100, 397})
    for (const std::int32_t rows : {0, 1, 24, 77, 500})
      for (const int ranks : {1, 2, 3, 4, 5, 9, 64}) {
        const TileMap map(width, rows, make_equal(ranks));
        std::int32_t nodes = 0;
        for (int i = 0; i < map.tiles(); ++i) {
          EXPECT_GT(map.nodes(i), 0);
          EXPECT_LE(3 * map.nodes(i), kMaxBlock) << "limit of the kernels";
          EXPECT_EQ(map.find_tile(map.start(i)), i);
          EXPECT_EQ(map.find_tile(map.start(i + 1) - 1), i);
          nodes += map.nodes(i);
          for (int j = 0; j <= i; ++j) {
            int owners = 0;
            for (int place = 0; place < map.places(); ++place) owners += map.has_row(place, i) && map.has_column(place, j) ? 1 : 0;
            ASSERT_EQ(owners, 1);
            EXPECT_TRUE(map.has_row(map.owner(i, j), i) && map.has_column(map.owner(i, j), j));
          }
        }
        EXPECT_EQ(nodes, width + rows);
        EXPECT_EQ(map.start(map.pivot_tiles()), width) << "a tile mixes pivots and other rows";
      }
}

TEST(TileMap, work_and_entries_add_up_to_those_of_the_front) {
  for (const int ranks : {1, 2, 7, 64}) {
    const TileMap map(300, 700, make_equal(ranks));
    const std::vector<double> operations = map.count_operations();
    const std::vector<std::int64_t> entries = map.count_entries();
    EXPECT_NEAR(std::accumulate(operations.begin(), operations.end(), 0.0), count_flops(300, 1000), 1e-9 * count_flops(300, 1000));
    EXPECT_EQ(std::accumulate(entries.begin(), entries.end(), std::int64_t{0}), count_entries(300, 1000));
  }
}

TEST(TileMap, ranks_get_their_shares_of_a_wide_front) {
  const std::vector<std::vector<FrontShare>> groups{
      make_equal(2), make_equal(5), make_equal(16), {{3, 0.1}, {4, 0.3}, {5, 0.3}, {6, 0.3}}, {{0, 0.75}, {1, 0.25}}};
  for (const std::vector<FrontShare>& shares : groups) {
    const TileMap map(1500, 1500, shares);
    const std::vector<double> operations = map.count_operations();
    const double all = std::accumulate(operations.begin(), operations.end(), 0.0);
    for (std::size_t place = 0; place < shares.size(); ++place)
      EXPECT_NEAR(operations[place] / all / shares[place].fraction, 1, 0.15) << shares.size() << " ranks, place " << place;
  }
}

// In one dimension a panel would go to all ranks, and all but one would wait for it.
TEST(TileMap, rows_and_columns_of_a_large_group_lie_on_about_the_root_of_its_ranks) {
  const TileMap map(1000, 1000, make_equal(64));
  for (int k = 0; k < map.pivot_tiles(); ++k) {
    std::set<int> in_column, in_row;
    for (int i = k; i < map.tiles(); ++i) in_column.insert(map.owner(i, k));
    for (int j = 0; j <= k; ++j) in_row.insert(map.owner(k, j));
    EXPECT_LE(in_column.size(), 8U);
    EXPECT_LE(in_row.size(), 8U);
  }
}

TEST(TileMap, knows_the_last_column_where_a_rank_has_a_tile) {
  for (const int ranks : {1, 3, 9, 64}) {
    const TileMap map(60, 130, make_equal(ranks));
    for (int place = 0; place < ranks; ++place) {
      int last = -1;
      for (int j = 0; j < map.tiles(); ++j)
        for (int i = j; i < map.tiles(); ++i)
          if (map.owner(i, j) == place) last = j;
      EXPECT_EQ(map.find_last_column(place), last);
    }
  }
}

/// A child of 40 pivots whose 130 rows are scattered in a parent of 90 pivots and 150 rows.
SharedChild make_child(const std::vector<FrontShare>& shares) {
  SharedChild child{TileMap(40, 130, shares), 40, {}, {}, -1, -1};
  for (std::int32_t a = 0; a < 130; ++a) child.node_of_row.push_back(a < 60 ? a : 60 + (a - 60) * 5 / 2);
  return child;
}

TEST(TileMap, a_contribution_block_goes_to_the_parent_completely_and_once) {
  for (const int below : {1, 2, 4, 9})
    for (const int above : {2, 5, 16}) {
      const SharedChild child = make_child(make_equal(below));
      const TileMap parent(90, 150, make_equal(above));
      std::int64_t numbers = 0;
      std::set<std::pair<std::int32_t, std::int32_t>> seen;
      for (int from = 0; from < below; ++from)
        for (int to = 0; to < above; ++to)
          for_pieces(child, from, parent, to, [&](const Piece& piece) {
            numbers += piece.count();
            for (std::int32_t b = piece.b_begin; b < piece.b_end; ++b)
              for (std::int32_t a = std::max(piece.a_begin, piece.a_begin == piece.b_begin ? b : piece.a_begin); a < piece.a_end; ++a) {
                EXPECT_TRUE(seen.emplace(a, b).second);
                const auto row = child.node_of_row[a], column = child.node_of_row[b];
                EXPECT_EQ(parent.owner(parent.find_tile(row), parent.find_tile(column)), to);
                EXPECT_EQ(child.map.owner(child.map.find_tile(40 + a), child.map.find_tile(40 + b)), from);
              }
          });
      EXPECT_EQ(numbers, 390 * 391 / 2);
      EXPECT_EQ(seen.size(), 130U * 131 / 2);
    }
}

TEST(TileMap, every_partial_sum_goes_to_one_place_of_the_parent) {
  const SharedChild child = make_child(make_equal(9));
  const TileMap parent(90, 150, make_equal(16));
  for (int from = 0; from < 9; ++from) {
    std::map<std::int32_t, int> sent;
    for (int to = 0; to < 16; ++to)
      for_sums(child, from, parent, to, [&](std::int32_t a) {
        ++sent[a];
        EXPECT_TRUE(parent.has_row(to, parent.find_tile(child.node_of_row[a])));
      });
    for (std::int32_t a = 0; a < 130; ++a) EXPECT_EQ(sent[a], child.map.has_row(from, child.map.find_tile(40 + a)) ? 1 : 0);
  }
}

}  // namespace
}  // namespace carillon::ldlt
