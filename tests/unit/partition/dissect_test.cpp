#include "partition/dissect.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <set>

#include "partition/vertex_cover.hpp"

namespace carillon::partition {
namespace {

using Ints = std::vector<std::int32_t>;
using Edges = std::vector<std::pair<std::int32_t, std::int32_t>>;

/// nx x ny x nz vertices, neighbours along the axes.
Graph make_grid(std::int32_t nx, std::int32_t ny, std::int32_t nz) {
  Graph graph;
  graph.offsets.push_back(0);
  for (std::int32_t z = 0; z < nz; ++z)
    for (std::int32_t y = 0; y < ny; ++y)
      for (std::int32_t x = 0; x < nx; ++x) {
        const std::int32_t v = x + nx * (y + ny * z);
        if (z > 0) graph.neighbours.push_back(v - nx * ny);
        if (y > 0) graph.neighbours.push_back(v - nx);
        if (x > 0) graph.neighbours.push_back(v - 1);
        if (x + 1 < nx) graph.neighbours.push_back(v + 1);
        if (y + 1 < ny) graph.neighbours.push_back(v + nx);
        if (z + 1 < nz) graph.neighbours.push_back(v + nx * ny);
        graph.offsets.push_back(static_cast<std::int32_t>(graph.neighbours.size()));
      }
  return graph;
}

/// Vertices of each connected component that remains when the last `removed` positions of the order are removed.
Ints measure_pieces(const Graph& graph, const Ints& position, std::int32_t removed) {
  const std::int32_t kept = graph.vertex_count() - removed;
  std::vector<bool> seen(position.size(), false);
  Ints pieces;
  for (std::int32_t start = 0; start < graph.vertex_count(); ++start) {
    if (seen[start] || position[start] >= kept) continue;
    Ints front{start};
    seen[start] = true;
    for (std::size_t i = 0; i < front.size(); ++i)
      for (std::int32_t k = graph.offsets[front[i]]; k < graph.offsets[front[i] + 1]; ++k) {
        const std::int32_t to = graph.neighbours[k];
        if (seen[to] || position[to] >= kept) continue;
        seen[to] = true;
        front.push_back(to);
      }
    pieces.push_back(static_cast<std::int32_t>(front.size()));
  }
  return pieces;
}

bool is_permutation(Ints position) {
  std::sort(position.begin(), position.end());
  Ints all(position.size());
  std::iota(all.begin(), all.end(), 0);
  return position == all;
}

TEST(Cover, is_as_small_as_the_smallest_of_all_subsets) {
  std::mt19937 random(5);
  for (int round = 0; round < 300; ++round) {
    const int left = 1 + static_cast<int>(random() % 6);
    const int right = 1 + static_cast<int>(random() % 6);
    Edges edges;
    for (int a = 0; a < left; ++a)
      for (int b = 0; b < right; ++b)
        if (random() % 3 == 0) edges.emplace_back(a, 100 + b);
    const Ints cover = cover_edges(edges);
    const auto covers = [&](const auto& has) {
      return std::all_of(edges.begin(), edges.end(), [&](const auto& edge) { return has(edge.first) || has(edge.second); });
    };
    EXPECT_TRUE(covers([&](std::int32_t v) { return std::binary_search(cover.begin(), cover.end(), v); }));
    int fewest = left + right;
    for (unsigned set = 0; set < 1U << (left + right); ++set)
      if (covers([&](std::int32_t v) { return (set >> (v < 100 ? v : left + v - 100) & 1U) != 0; }))
        fewest = std::min(fewest, __builtin_popcount(set));
    EXPECT_EQ(cover.size(), static_cast<std::size_t>(fewest)) << "round " << round;
  }
}

TEST(Dissect, a_separator_of_a_rod_is_a_slice_and_parts_the_rod) {
  const Graph rod = make_grid(120, 5, 5);
  for (const std::int32_t largest : {100000, 100}) {
    const Dissection halves = dissect(rod, 2, largest);
    ASSERT_TRUE(is_permutation(halves.position));
    ASSERT_EQ(halves.separator.size(), 1U);
    EXPECT_LE(halves.separator[0], 35) << "a straight cut has 25 vertices";
    const Ints pieces = measure_pieces(rod, halves.position, halves.separator[0]);
    ASSERT_EQ(pieces.size(), 2U);
    EXPECT_GT(*std::min_element(pieces.begin(), pieces.end()), 0.35 * rod.vertex_count());
  }
}

TEST(Dissect, any_number_of_parts_is_parted_by_as_many_separators_but_one) {
  const Graph block = make_grid(16, 14, 12);
  for (const auto& [parts, largest] :
       {std::pair{1, 9}, {2, 9}, {3, 9}, {5, 9}, {8, 9}, {13, 9}, {64, 9}, {3, 9999}, {64, 9999}, {8, 1500}}) {
    const Dissection tree = dissect(block, parts, largest);
    EXPECT_TRUE(is_permutation(tree.position)) << parts;
    EXPECT_EQ(tree.separator.size(), static_cast<std::size_t>(parts - 1));
    if (parts > 1) {
      EXPECT_GE(measure_pieces(block, tree.position, tree.separator.back()).size(), 2U) << parts;
    }
    EXPECT_EQ(tree.position, dissect(block, parts, largest).position) << "not deterministic";
  }
}

class HardGraphs : public testing::TestWithParam<std::int32_t> {};
INSTANTIATE_TEST_SUITE_P(LargestGathered, HardGraphs, testing::Values(0, 300'000));

TEST_P(HardGraphs, are_ordered_too) {
  const std::int32_t largest = GetParam();
  EXPECT_TRUE(dissect(Graph{{0}, {}}, 4, largest).position.empty());
  EXPECT_EQ(dissect(Graph{{0, 0}, {}}, 8, largest).position, Ints{0});
  for (const int parts : {2, 16}) {
    EXPECT_TRUE(is_permutation(dissect(Graph{Ints(51, 0), {}}, parts, largest).position)) << "fifty vertices without an edge";
    EXPECT_TRUE(is_permutation(dissect(make_grid(3, 1, 1), parts, largest).position)) << "fewer vertices than parts";
  }
  Graph clique;
  clique.offsets.push_back(0);
  for (std::int32_t v = 0; v < 40; ++v) {
    for (std::int32_t w = 0; w < 40; ++w)
      if (w != v) clique.neighbours.push_back(w);
    clique.offsets.push_back(static_cast<std::int32_t>(clique.neighbours.size()));
  }
  EXPECT_TRUE(is_permutation(dissect(clique, 4, largest).position));
}

}  // namespace
}  // namespace carillon::partition
