// Distribution of a mesh from rank 0 to 1, 2 and 3 ranks: every element and node arrives once, and errors reach all ranks alike.
#include "precompute/mesh/distributed/distribute.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <set>

#include "precompute/mesh/distributed/bisect.hpp"
#include "runtime/base/error.hpp"
#include "tests/support/box_mesh.hpp"
#include "tests/support/catch_message.hpp"

namespace carillon::mesh {
namespace {

using testing::HasSubstr;
using tests::catch_message;

constexpr Vec3 kSize{0.3, 0.2, 0.1};

const comm::Communicator& world() {
  static const comm::Communicator comm(MPI_COMM_WORLD);
  return comm;
}

DistributedMesh distribute_box(const mesh::TetMesh& whole, const std::vector<std::int32_t>& fixed = {}) {
  if (!world().is_root()) return distribute(world(), {}, {}, {.elimination_order = true});
  return distribute(world(), whole, fixed, {.elimination_order = true});
}

TEST(Distribute, gives_every_rank_its_own_elements_and_their_nodes_and_nothing_else) {
  const auto box = tests::make_box({6, 4, 3}, kSize, 2);
  const DistributedMesh pieces = distribute_box(box, {0, 1, 2});
  const LocalMesh& local = pieces.local;
  std::set<std::int32_t> touched, fixed;
  for (int e = 0; e < local.tet_count(); ++e)
    for (int i = 0; i < 10; ++i) {
      const std::int32_t node = local.tets[10 * e + i];
      ASSERT_EQ(local.node_in_mesh[node], box.tet(local.tet_in_mesh[e])[i]);
      ASSERT_EQ(local.nodes_m[node], box.nodes_m[local.node_in_mesh[node]]);
      touched.insert(node);
    }
  EXPECT_EQ(touched.size(), local.nodes_m.size());
  EXPECT_EQ(*touched.rbegin() + 1, static_cast<int>(local.nodes_m.size()));
  for (int i = 0; i < local.free_nodes; ++i) EXPECT_EQ(local.row[i], local.first_row + i);
  for (std::size_t i = 0; i < local.row.size(); ++i) EXPECT_EQ(local.row[i] < 0, local.node_in_mesh[i] < 3);

  std::vector<int> times(box.nodes_m.size(), 0), elements(box.tet_count(), 0);
  for (int i = 0; i < local.owned_nodes; ++i) ++times[local.node_in_mesh[i]];
  for (const auto e : local.tet_in_mesh) ++elements[e];
  world().sum(times);
  world().sum(elements);
  EXPECT_THAT(times, testing::Each(1));
  EXPECT_THAT(elements, testing::Each(1));

  ASSERT_EQ(static_cast<int>(pieces.report.ranks.size()), world().size());
  EXPECT_EQ(pieces.report.ranks[world().rank()].halo_nodes, static_cast<std::int64_t>(local.nodes_m.size()) - local.owned_nodes);
  EXPECT_EQ(pieces.report.edge_cut > 0, world().size() > 1);
  EXPECT_LT(pieces.report.element_balance, 1.1);
  EXPECT_LT(pieces.report.node_balance, 1.2);
  EXPECT_EQ(pieces.free_nodes, static_cast<std::int64_t>(box.nodes_m.size()) - 3);
  EXPECT_EQ(pieces.nodes, static_cast<std::int64_t>(box.nodes_m.size()));
}

TEST(Distribute, orders_the_free_nodes_for_elimination_by_a_permutation_on_rank_0) {
  const DistributedMesh pieces = distribute_box(tests::make_box({4, 3, 3}, kSize), {5});
  auto position = pieces.elimination_position;
  if (world().rank() != 0) {
    EXPECT_TRUE(position.empty());
    return;
  }
  std::sort(position.begin(), position.end());
  std::vector<std::int32_t> natural(pieces.free_nodes);
  std::iota(natural.begin(), natural.end(), 0);
  EXPECT_EQ(position, natural);
}

TEST(Distribute, numbers_two_separate_bodies_and_lists_the_fixed_nodes_of_each) {
  auto both = tests::make_box({2, 2, 2}, kSize);
  const auto other = tests::make_box({3, 2, 2}, kSize, 1, {1, 0, 0});
  const auto shift = static_cast<std::int32_t>(both.nodes_m.size());
  both.nodes_m.insert(both.nodes_m.end(), other.nodes_m.begin(), other.nodes_m.end());
  both.nodes_m.push_back({9, 9, 9});  // unused node
  for (const auto node : other.tets) both.tets.push_back(node + shift);
  const DistributedMesh pieces = distribute_box(both, {shift, shift + 1});
  EXPECT_EQ(pieces.components, 2);
  ASSERT_EQ(pieces.fixed_m.size(), 2u);
  EXPECT_TRUE(pieces.fixed_m[0].empty());
  ASSERT_EQ(pieces.fixed_m[1].size(), 2u);
  EXPECT_EQ(pieces.fixed_m[1][0], (Vec3{1, 0, 0}));
  EXPECT_EQ(pieces.nodes, static_cast<std::int64_t>(both.nodes_m.size()) - 1);
  for (std::size_t i = 0; i < pieces.local.nodes_m.size(); ++i)
    EXPECT_EQ(pieces.local.component[i], pieces.local.nodes_m[i][0] >= 1 ? 1 : 0);
}

TEST(Distribute, fails_on_every_rank_with_one_message_when_nothing_can_move) {
  const auto box = tests::make_box({2, 2, 2}, kSize);
  std::vector<std::int32_t> all(box.nodes_m.size());
  std::iota(all.begin(), all.end(), 0);
  EXPECT_THAT(catch_message<InputError>([&] { distribute_box(box, all); }), HasSubstr("names every node"));
  EXPECT_THROW(distribute_box(box, {-1}), InputError);
}

TEST(Distribute, fails_on_every_rank_when_there_are_fewer_elements_than_ranks) {
  mesh::TetMesh one;
  one.nodes_m = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  one.tets = {0, 1, 2, 3};
  if (world().size() == 1) {
    EXPECT_EQ(distribute_box(one).free_nodes, 4);
  } else {
    EXPECT_THROW(distribute_box(one), InputError);
  }
}

TEST(LocalMesh, survives_as_bytes) {
  LocalMesh local = distribute_box(tests::make_box({3, 2, 2}, kSize, 2), {0, 4}).local;
  local.doubt_m.assign(local.nodes_m.size(), {1, 2, 3});
  const LocalMesh copy = deserialise(serialise(local));
  EXPECT_EQ(copy.order, 2);
  EXPECT_EQ(copy.tets, local.tets);
  EXPECT_EQ(copy.tet_in_mesh, local.tet_in_mesh);
  EXPECT_EQ(copy.region, local.region);
  EXPECT_EQ(copy.nodes_m, local.nodes_m);
  EXPECT_EQ(copy.doubt_m, local.doubt_m);
  EXPECT_EQ(copy.node_in_mesh, local.node_in_mesh);
  EXPECT_EQ(copy.row, local.row);
  EXPECT_EQ(copy.component, local.component);
  EXPECT_EQ(copy.fixed_by, local.fixed_by);
  EXPECT_EQ(copy.free_nodes, local.free_nodes);
  EXPECT_EQ(copy.owned_nodes, local.owned_nodes);
  EXPECT_EQ(copy.first_row, local.first_row);
  EXPECT_TRUE(deserialise(serialise(LocalMesh{})).tets.empty());
}

TEST(SupportingPoints, span_as_much_as_all_points_do) {
  const std::vector<Vec3> points{{0, 0, 0}, {1, 0, 0}, {5, 0, 0}, {2, 3, 0}, {2, 1, 0}};
  EXPECT_THAT(find_supporting_points(points), testing::ElementsAre(points[0], points[2], points[3]));
  EXPECT_THAT(find_supporting_points(std::vector<Vec3>{points[3], points[1]}), testing::ElementsAre(points[3], points[1]));
  const std::vector<FixedPoint> two{{points[0], 1}, {points[1], 0}, {points[2], 1}};
  EXPECT_THAT(find_supporting_points(two, 3),
              testing::ElementsAre(std::vector<Vec3>{points[1]}, std::vector<Vec3>{points[0], points[2]}, std::vector<Vec3>{}));
  EXPECT_EQ(list_points(find_supporting_points(two, 3)).size(), 3u);
}

// Points of a long bar in random order; ranks have different numbers of them, the last none.
TEST(Bisect, gives_every_rank_a_stretch_of_a_bar_of_nearly_equal_count) {
  constexpr int kCount = 101;
  std::vector<int> order(kCount);
  std::iota(order.begin(), order.end(), 0);
  std::shuffle(order.begin(), order.end(), std::mt19937(5));
  const int ranks = world().size(), rank = world().rank();
  const int first = ranks == 1 || rank == 0 ? 0 : 60, last = ranks == 1 ? kCount : rank == 0 ? 60 : rank == 1 ? kCount : 60;
  std::vector<Vec3> centres;
  for (int i = first; i < last; ++i) centres.push_back({0.1 * order[i], 0.01 * (i % 2), 0.01 * (i % 3)});
  const auto part = bisect(world(), centres, first);
  ASSERT_EQ(part.size(), centres.size());
  std::vector<std::int32_t> count(ranks, 0);
  std::vector<double> low(ranks, 1e9), high(ranks, -1e9);
  for (std::size_t e = 0; e < part.size(); ++e) {
    ++count[part[e]];
    low[part[e]] = std::min(low[part[e]], centres[e][0]);
    high[part[e]] = std::max(high[part[e]], centres[e][0]);
  }
  world().sum(count);
  world().min(low);
  world().max(high);
  EXPECT_EQ(std::accumulate(count.begin(), count.end(), 0), kCount);
  for (int r = 0; r < ranks; ++r) EXPECT_NEAR(count[r], 1.0 * kCount / ranks, 1);
  for (int r = 0; r + 1 < ranks; ++r) EXPECT_TRUE(high[r] < low[r + 1] || high[r + 1] < low[r]) << r;
}

// All elements at one place: only their numbers decide.
TEST(Bisect, separates_elements_in_one_place_by_their_numbers) {
  constexpr int kOwn = 4;
  const auto part = bisect(world(), std::vector<Vec3>(kOwn, Vec3{1, 1, 1}), kOwn * world().rank());
  EXPECT_EQ(part, std::vector<std::int32_t>(kOwn, world().rank()));
}

}  // namespace
}  // namespace carillon::mesh
