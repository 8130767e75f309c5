#include "precompute/ldlt/mapping.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "partition/dissect.hpp"
#include "precompute/ldlt/level_subtrees.hpp"
#include "tests/support/mapping_messages.hpp"

namespace carillon::ldlt {
namespace {

using partition::Graph;

double sum(const std::vector<double>& values) { return std::accumulate(values.begin(), values.end(), 0.0); }

/// A block of n^3 nodes with 26 neighbours each, in elimination order.
std::vector<FrontCost> make_block(std::int32_t n, int parts) {
  Graph graph;
  graph.offsets.push_back(0);
  for (std::int32_t v = 0; v < n * n * n; ++v) {
    const std::int32_t x = v % n;
    const std::int32_t y = v / n % n;
    const std::int32_t z = v / n / n;
    for (std::int32_t dz = -1; dz <= 1; ++dz)
      for (std::int32_t dy = -1; dy <= 1; ++dy)
        for (std::int32_t dx = -1; dx <= 1; ++dx) {
          const bool is_inside = x + dx >= 0 && x + dx < n && y + dy >= 0 && y + dy < n && z + dz >= 0 && z + dz < n;
          if (is_inside && (dx != 0 || dy != 0 || dz != 0)) graph.neighbours.push_back(v + dx + n * (dy + n * dz));
        }
    graph.offsets.push_back(static_cast<std::int32_t>(graph.neighbours.size()));
  }
  return list_costs(find_supernodes(partition::renumber(graph, partition::dissect(graph, parts).position), 0, graph.vertex_count()));
}

/// `leaves` equal fronts without a parent.
Forest make_leaves(int leaves) {
  Forest forest;
  for (int s = 0; s < leaves; ++s) {
    Supernode& node = forest.supernodes.emplace_back();
    node.first = 10 * s;
    node.width = 10;
  }
  return forest;
}

TEST(Mapping, equal_leaves_are_dealt_evenly) {
  for (const int ranks : {1, 2, 4, 8, 32}) {
    const std::vector<FrontCost> leaves = list_costs(make_leaves(32));
    const MappingCounts counts = count_mapping(leaves, choose_mapping(leaves, ranks));
    EXPECT_NEAR(counts.path_ratio(), 1, 1e-12) << ranks;
    EXPECT_NEAR(counts.fullest_ratio(), 1, 1e-12) << ranks;
    EXPECT_EQ(counts.shared_fronts, 0);
    EXPECT_EQ(sum(tests::count_messages(leaves, choose_mapping(leaves, ranks)).bytes), 0) << "nothing is shared, so nothing is sent";
  }
}

TEST(Mapping, a_single_front_is_shared_by_all_ranks) {
  Forest forest = make_leaves(1);
  forest.supernodes[0].width = 1000;
  const MappingCounts counts = count_mapping(list_costs(forest), Mapping(list_costs(forest), 5, 1));
  EXPECT_EQ(counts.shared_fronts, 1);
  EXPECT_NEAR(counts.path_ratio(), 1, 0.1) << "as evenly as tiles allow";
  EXPECT_NEAR(counts.shared_operations, counts.total_operations, 1e-9 * counts.total_operations);
}

TEST(Mapping, a_chain_of_fronts_is_shared_by_two_ranks) {
  Forest forest;
  for (int s = 0; s < 6; ++s) {
    Supernode& node = forest.supernodes.emplace_back();
    node.first = 50 * s;
    node.width = 50;
    node.parent = s < 5 ? s + 1 : -1;
    for (std::int32_t row = 50 * (s + 1); row < 300; ++row) node.rows.push_back(row);
  }
  // The lowest front, which has no children and less than a rank's work, is not shared.
  const MappingCounts counts = count_mapping(list_costs(forest), Mapping(list_costs(forest), 2, 1));
  EXPECT_NEAR(sum(counts.operations), counts.total_operations, 1e-9 * counts.total_operations);
  EXPECT_GE(counts.path_operations, counts.total_operations / 2);
  EXPECT_LE(counts.path_operations, calc_gang_operations(list_costs(forest), Mapping(list_costs(forest), 2, 1)) * (1 + 1e-12));
}

TEST(Mapping, two_ranks_send_half_of_each_contribution_block_to_a_shared_root) {
  Forest forest = make_leaves(3);
  forest.supernodes[2].width = 4;  // one panel, so nothing is sent inside the root
  for (const int leaf : {0, 1}) {
    forest.supernodes[leaf].parent = 2;
    forest.supernodes[leaf].rows = {20, 21, 22, 23};
  }
  const Mapping mapping(list_costs(forest), 2, 1);
  ASSERT_NE(mapping.owner(0), mapping.owner(1));
  ASSERT_EQ(mapping.list_shares(2).size(), 2U);
  EXPECT_NEAR(sum(tests::count_messages(list_costs(forest), mapping).bytes), 2 * 0.5 * 8 * (12 * 13 / 2), 1e-9);
}

/// Operations of the fronts owned by each rank alone.
std::vector<double> list_own(const std::vector<FrontCost>& fronts, const Mapping& mapping) {
  std::vector<double> own(mapping.ranks(), 0.0);
  for (std::size_t s = 0; s < fronts.size(); ++s)
    if (mapping.owner(static_cast<std::int32_t>(s)) >= 0) own[mapping.owner(static_cast<std::int32_t>(s))] += fronts[s].operations;
  return own;
}

TEST(Mapping, subtrees_are_exchanged_until_two_ranks_are_level) {
  // Below a root shared by both ranks: 6 + 5 and 4 + 3 + 2; exchanging 5 for 4 levels to 10 and 10.
  std::vector<FrontCost> fronts;
  for (const double operations : {6.0, 5.0, 4.0, 3.0, 2.0}) fronts.push_back({5, 10, 10, operations, operations});
  fronts.push_back({-1, 100, 0, 20, 20});
  Mapping mapping(fronts, 2, 1);
  ASSERT_EQ(mapping.owner(5), -1);
  for (const int s : {0, 1}) mapping.set_owner(s, 0);
  for (const int s : {2, 3, 4}) mapping.set_owner(s, 1);
  level_subtrees(fronts, mapping);
  EXPECT_EQ(list_own(fronts, mapping), (std::vector<double>{10, 10}));
  EXPECT_EQ(mapping.owner(5), -1);
}

TEST(Mapping, a_subtree_too_large_to_move_is_shared_at_its_root) {
  // 7 of the 12 below the root are one subtree of three fronts: 3 + 3 and 1 above them.
  std::vector<FrontCost> fronts{{2, 10, 10, 3, 3}, {2, 10, 10, 3, 3}, {4, 30, 10, 1, 1}, {4, 10, 10, 5, 5}, {-1, 100, 0, 20, 20}};
  Mapping mapping(fronts, 2, 1);
  for (const int s : {0, 1, 2}) mapping.set_owner(s, 0);
  mapping.set_owner(3, 1);
  ASSERT_EQ(mapping.owner(4), -1);
  level_subtrees(fronts, mapping);
  EXPECT_EQ(mapping.owner(2), -1);
  EXPECT_EQ(mapping.list_shares(2).size(), 2U);
  EXPECT_EQ(list_own(fronts, mapping), (std::vector<double>{6, 5})) << "no exchange levels 6 and 5";
}

TEST(Mapping, keeps_what_cannot_be_levelled) {
  for (const int ranks : {1, 2, 3}) {
    std::vector<FrontCost> fronts{{-1, 10, 0, 5, 5}};  // one front
    Mapping one(fronts, ranks, 1);
    level_subtrees(fronts, one);
    EXPECT_EQ(count_mapping(fronts, one).path_operations, count_mapping(fronts, Mapping(fronts, ranks, 1)).path_operations);
    const std::vector<FrontCost> leaves = list_costs(make_leaves(7));  // no front has a parent
    Mapping many(leaves, ranks, 1);
    level_subtrees(leaves, many);
    EXPECT_EQ(list_own(leaves, many), list_own(leaves, Mapping(leaves, ranks, 1)));
    Mapping none({}, ranks, 1);
    level_subtrees({}, none);
  }
}

TEST(Mapping, ranks_of_a_front_are_among_those_of_the_front_above) {
  for (const int ranks : {2, 3, 5, 16, 64}) {
    const std::vector<FrontCost> forest = make_block(15, ranks);
    const Mapping mapping = choose_mapping(forest, ranks);
    for (std::size_t s = 0; s < forest.size(); ++s) {
      if (forest[s].parent < 0) continue;
      std::vector<bool> is_above(ranks, false);
      for (const FrontShare& share : mapping.list_shares(forest[s].parent)) is_above[share.rank] = true;
      for (const FrontShare& share : mapping.list_shares(static_cast<std::int32_t>(s)))
        EXPECT_TRUE(is_above[share.rank]) << "front " << s << " on " << ranks << " ranks";
    }
  }
}

TEST(Mapping, shares_add_up_to_the_total) {
  const std::vector<FrontCost> forest = make_block(15, 16);
  for (const int ranks : {1, 2, 3, 7, 16, 64, 200}) {
    const Mapping mapping = choose_mapping(forest, ranks);
    for (std::size_t s = 0; s < forest.size(); ++s) {
      double all = 0;
      int before = -1;
      for (const FrontShare& share : mapping.list_shares(static_cast<std::int32_t>(s))) {
        EXPECT_GT(share.rank, before);
        EXPECT_LT(share.rank, ranks);
        EXPECT_GT(share.fraction, 0);
        before = share.rank;
        all += share.fraction;
      }
      EXPECT_NEAR(all, 1, 1e-9);
    }
    const MappingCounts counts = count_mapping(forest, mapping);
    EXPECT_NEAR(sum(counts.operations), counts.total_operations, 1e-9 * counts.total_operations) << ranks;
    EXPECT_NEAR(sum(counts.entries), counts.total_entries, 1e-9 * counts.total_entries) << ranks;
    EXPECT_GE(counts.path_ratio(), 1 - 1e-9) << "no rank is faster than an equal share";
    if (ranks == 1) {
      EXPECT_EQ(counts.path_operations, counts.total_operations);
      const tests::MappingMessages sent = tests::count_messages(forest, mapping);
      EXPECT_EQ(sum(sent.messages) + sum(sent.bytes) + sum(sent.solve_bytes), 0);
    }
  }
}

TEST(Mapping, path_and_memory_of_a_block_stay_near_an_equal_share) {
  for (const int ranks : {2, 4, 8, 16, 32, 64}) {
    const std::vector<FrontCost> forest = make_block(24, ranks);
    const Mapping mapping = choose_mapping(forest, ranks);
    const MappingCounts counts = count_mapping(forest, mapping);
    EXPECT_LE(counts.path_ratio(), ranks <= 16 ? 1.5 : 2.5) << ranks;
    EXPECT_LE(counts.fullest_ratio(), ranks <= 32 ? 1.3 : 1.35) << ranks << " ranks; on 64 each has only 216 nodes, and tiles are coarse";
    EXPECT_LE(tests::count_messages(forest, mapping).most_planned_fronts, 40 * std::log2(ranks))
        << "a rank plans its path to the root, not the whole tree";
  }
}

TEST(Mapping, ranks_end_the_fronts_that_they_share_together) {
  for (const int ranks : {2, 3, 4, 8}) {
    const std::vector<FrontCost> forest = make_block(24, ranks);
    const Mapping mapping = choose_mapping(forest, ranks), divided(forest, ranks, 1);
    const MappingCounts chosen = count_mapping(forest, mapping);
    const MappingCounts proportional = count_mapping(forest, divided);
    EXPECT_LE(chosen.path_operations, proportional.path_operations);
    EXPECT_LE(chosen.path_ratio(), ranks == 2 ? 1.02 : 1.25) << ranks << " ranks";
    EXPECT_LE(calc_gang_operations(forest, mapping), calc_gang_operations(forest, divided))
        << ranks << " ranks: waiting times are lower too";
  }
}

}  // namespace
}  // namespace carillon::ldlt
