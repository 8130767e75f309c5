// Elements that change ranks: none is lost, and all ranks have the same number.
#include "precompute/mesh/distributed/level_elements.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

namespace carillon::mesh {
namespace {

using Counts = std::vector<std::int64_t>;
using Ints = std::vector<std::int32_t>;

/// Counts after all transfers; transfers of a sender are consecutive.
Counts carry_out(Counts counts) {
  int from = -1;
  std::int64_t gone = 0;
  for (const Transfer& one : plan_transfers(counts)) {
    EXPECT_GE(one.from, from);
    EXPECT_NE(one.from, one.to);
    if (one.from != from) gone = 0;
    from = one.from;
    const std::int64_t moved = one.end - gone;
    EXPECT_GT(moved, 0);
    gone = one.end;
    counts[one.from] -= moved;
    counts[one.to] += moved;
  }
  return counts;
}

TEST(PlanTransfers, levels_any_number_of_ranks_and_loses_nothing) {
  std::mt19937 random(7);
  for (const std::size_t ranks : {1U, 2U, 3U, 64U, 1024U, 4096U})
    for (const std::int64_t mean : {0, 1, 3, 190}) {
      Counts counts(ranks);
      for (std::int64_t& count : counts) count = mean == 0 ? 0 : static_cast<std::int64_t>(random() % static_cast<unsigned>(2 * mean + 1));
      const Counts level = carry_out(counts);
      EXPECT_EQ(std::accumulate(level.begin(), level.end(), std::int64_t{0}),
                std::accumulate(counts.begin(), counts.end(), std::int64_t{0}));
      const auto [least, most] = std::minmax_element(level.begin(), level.end());
      EXPECT_LE(*most - *least, 1) << ranks << " ranks";
    }
  EXPECT_EQ(carry_out({13, 13, 13, 4}), (Counts{11, 11, 11, 10}));
  EXPECT_EQ(carry_out({0, 0, 9}), (Counts{3, 3, 3}));
  EXPECT_TRUE(plan_transfers({5, 5, 4}).empty());
}

TEST(LevelElements, gives_the_first_of_a_rank_and_none_twice) {
  const comm::Communicator world(MPI_COMM_WORLD);
  // Distributed in turn: element g on rank g * ranks / all, except that the last rank has half of all; three elements per position.
  const std::int32_t all = 600;
  Ints rank, position;
  for (std::int32_t g = world.rank(); g < all; g += world.size()) {
    rank.push_back(g < all / 2 ? 2 * g * (world.size() - 1) / all : world.size() - 1);
    position.push_back(g / 3 - 50);  // including negative ones
  }
  const Ints before = rank;
  level_elements(world, rank, position);
  Counts counts(world.size(), 0);
  for (const std::int32_t one : rank) ++counts[one];
  world.sum(std::span<std::int64_t>(counts));
  EXPECT_EQ(std::accumulate(counts.begin(), counts.end(), std::int64_t{0}), all);
  const auto [least, most] = std::minmax_element(counts.begin(), counts.end());
  EXPECT_LE(*most - *least, 2 * 3) << "elements at one position go together";
  // Elements that stay come after those that move.
  for (std::int32_t r = 0; r < world.size(); ++r) {
    std::int32_t last_gone = -1000;
    std::int32_t first_left = 1000;
    for (std::size_t e = 0; e < rank.size(); ++e) {
      if (before[e] != r) continue;
      if (rank[e] != r) last_gone = std::max(last_gone, position[e]);
      if (rank[e] == r) first_left = std::min(first_left, position[e]);
    }
    const Ints gone = world.all_gather(Ints{last_gone});
    const Ints left = world.all_gather(Ints{first_left});
    EXPECT_LT(*std::max_element(gone.begin(), gone.end()), *std::min_element(left.begin(), left.end()));
  }
}

}  // namespace
}  // namespace carillon::mesh
