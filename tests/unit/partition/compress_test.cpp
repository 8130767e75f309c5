#include "partition/compress.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>
#include <set>

#include "partition/dissect.hpp"
#include "partition/metis.hpp"
#include "tests/support/box_mesh.hpp"
#include "tests/unit/partition/fill.hpp"

namespace carillon::partition {
namespace {

using Vertices = std::vector<std::int32_t>;

Graph make_graph(std::int32_t count, const std::set<std::pair<std::int32_t, std::int32_t>>& edges) {
  std::vector<std::set<std::int32_t>> near(count);
  for (const auto& [a, b] : edges) {
    near[a].insert(b);
    near[b].insert(a);
  }
  Graph graph{{0}, {}};
  for (const auto& list : near) {
    graph.neighbours.insert(graph.neighbours.end(), list.begin(), list.end());
    graph.offsets.push_back(static_cast<std::int32_t>(graph.neighbours.size()));
  }
  return graph;
}

Graph make_t10_graph(std::array<int, 3> cells) {
  const auto box = tests::make_box(cells, {1, 1, 1}, 2);
  return make_node_graph(box.tets, 10, static_cast<std::int32_t>(box.nodes_m.size()));
}

/// A vertex and its neighbours.
std::set<std::int32_t> list_closed(const Graph& graph, std::int32_t v) {
  std::set<std::int32_t> closed(graph.neighbours.begin() + graph.offsets[v], graph.neighbours.begin() + graph.offsets[v + 1]);
  closed.insert(v);
  return closed;
}

bool dominates(const Graph& graph, std::int32_t u, std::int32_t v) {
  const auto of_u = list_closed(graph, u);
  const auto of_v = list_closed(graph, v);
  return u != v && of_u.contains(v) && std::includes(of_u.begin(), of_u.end(), of_v.begin(), of_v.end()) && (of_u != of_v || u < v);
}

/// Checks the core against the definition: whether it is used, and that a dominated vertex is in a separator exactly if its core requires
/// it.
bool expect_core_of_definition(const Graph& graph) {
  const CompressedGraph compressed(graph, 1);
  const std::int32_t n = graph.vertex_count();
  Vertices kept;
  std::vector<Vertices> hosts(n);
  for (std::int32_t v = 0; v < n; ++v) {
    for (std::int32_t u = 0; u < n; ++u)
      if (dominates(graph, u, v)) hosts[v].push_back(u);
    if (hosts[v].empty()) kept.push_back(v);
  }
  if (2 * static_cast<std::int32_t>(kept.size()) > n) {
    EXPECT_EQ(compressed.core().neighbours, graph.neighbours) << "compression is not worthwhile";
    return false;
  }
  EXPECT_EQ(compressed.core().vertex_count(), static_cast<std::int32_t>(kept.size()));
  if (testing::Test::HasFailure()) return true;
  Vertices number(n, -1);
  for (std::size_t c = 0; c < kept.size(); ++c) number[kept[c]] = static_cast<std::int32_t>(c);
  for (std::size_t c = 0; c < kept.size(); ++c) {
    std::set<std::int32_t> expected;
    for (const std::int32_t u : list_closed(graph, kept[c]))
      if (u != kept[c] && number[u] >= 0) expected.insert(number[u]);
    const Graph& core = compressed.core();
    EXPECT_EQ(Vertices(core.neighbours.begin() + core.offsets[c], core.neighbours.begin() + core.offsets[c + 1]),
              Vertices(expected.begin(), expected.end()));
  }
  Vertices position(kept.size());
  std::iota(position.begin(), position.end(), 0);
  std::shuffle(position.begin(), position.end(), std::mt19937(5));
  const Vertices order = compressed.expand_order(position);
  Vertices sorted = order;
  std::sort(sorted.begin(), sorted.end());
  for (std::int32_t v = 0; v < n; ++v) {
    EXPECT_EQ(sorted[v], v);
    for (const std::int32_t u : hosts[v]) {
      if (number[u] >= 0) {
        EXPECT_LT(order[v], order[u]);
      }
    }
  }
  for (std::size_t c = 0; c + 1 < kept.size(); ++c)
    for (std::size_t d = c + 1; d < kept.size(); ++d) EXPECT_EQ(order[kept[c]] < order[kept[d]], position[c] < position[d]);
  return true;
}

TEST(CompressedGraph, matches_the_definition) {
  EXPECT_TRUE(expect_core_of_definition(make_t10_graph({2, 2, 2})));
  EXPECT_TRUE(expect_core_of_definition(make_t10_graph({4, 1, 1})));
  const auto t4 = tests::make_box({3, 3, 1}, {1, 1, 1});
  expect_core_of_definition(make_node_graph(t4.tets, 4, static_cast<std::int32_t>(t4.nodes_m.size())));
  std::mt19937 random(11);
  int used = 0;
  for (int round = 0; round < 200; ++round) {
    const std::int32_t n = 2 + static_cast<std::int32_t>(random() % 14);
    std::set<std::pair<std::int32_t, std::int32_t>> edges;
    for (unsigned k = random() % (3 * n); k > 0; --k) {
      const auto a = static_cast<std::int32_t>(random() % n);
      const auto b = static_cast<std::int32_t>(random() % n);
      if (a != b) edges.emplace(std::min(a, b), std::max(a, b));
    }
    used += expect_core_of_definition(make_graph(n, edges)) ? 1 : 0;
  }
  EXPECT_GT(used, 10);
}

/// Core of elements by the definition: a node is dominated by one that is in all of its elements.
void expect_core_of_elements(const Vertices& elements, int width, std::int32_t nodes) {
  std::vector<std::set<std::int32_t>> of(nodes);
  for (std::size_t k = 0; k < elements.size(); ++k)
    if (elements[k] >= 0) of[elements[k]].insert(static_cast<std::int32_t>(k) / width);
  Vertices number(nodes, -1);
  std::int32_t kept = 0;
  for (std::int32_t v = 0; v < nodes; ++v) {
    bool is_dominated = false;
    for (std::int32_t u = 0; u < nodes; ++u)
      is_dominated = is_dominated || (u != v && !of[v].empty() && std::includes(of[u].begin(), of[u].end(), of[v].begin(), of[v].end()) &&
                                      (of[u] != of[v] || u < v));
    if (!is_dominated) number[v] = kept++;
  }
  const CompressedGraph compressed(elements, width, nodes, 1);
  const Graph graph = make_node_graph(elements, width, nodes);
  if (2 * kept > nodes) {
    EXPECT_EQ(compressed.core().neighbours, graph.neighbours);
    EXPECT_EQ(compressed.dominated_per_edge(), 0);
    return;
  }
  EXPECT_EQ(compressed.numbers(), number);
  Vertices list;
  for (std::int32_t v = 0; v < nodes; ++v)
    if (number[v] >= 0) list.push_back(v);
  Vertices scratch(nodes, -1);
  const Graph core = take_part(graph, list, scratch);
  EXPECT_EQ(compressed.core().offsets, core.offsets);
  EXPECT_EQ(compressed.core().neighbours, core.neighbours);
  if (!core.neighbours.empty()) {
    EXPECT_NEAR(kept + compressed.dominated_per_edge() * 0.5 * static_cast<double>(core.neighbours.size()), nodes, 1e-9);
  }
}

TEST(CompressedGraph, of_elements_needs_no_graph_of_all_nodes) {
  const auto t10 = tests::make_box({4, 3, 3}, {1, 1, 1}, 2);
  expect_core_of_elements(t10.tets, 10, static_cast<std::int32_t>(t10.nodes_m.size()));
  const auto t4 = tests::make_box({3, 3, 2}, {1, 1, 1});
  expect_core_of_elements(t4.tets, 4, static_cast<std::int32_t>(t4.nodes_m.size()));
  Vertices fixed = t10.tets;
  for (std::int32_t& node : fixed) node -= 40;
  expect_core_of_elements(fixed, 10, static_cast<std::int32_t>(t10.nodes_m.size()) - 40);
  std::mt19937 random(3);
  for (int round = 0; round < 200; ++round) {
    const auto nodes = static_cast<std::int32_t>(1 + random() % 20);
    const int width = static_cast<int>(1 + random() % 6);
    Vertices all(std::max(nodes, width), -1);  // with gaps
    std::iota(all.begin(), all.begin() + nodes, 0);
    Vertices elements;
    for (unsigned e = random() % 8; e > 0; --e) {
      std::shuffle(all.begin(), all.end(), random);
      elements.insert(elements.end(), all.begin(), all.begin() + width);
    }
    expect_core_of_elements(elements, width, nodes);
  }
  expect_core_of_elements({}, 10, 0);
  expect_core_of_elements({}, 10, 3);
}

TEST(CompressedGraph, of_elements_and_of_their_graph_give_the_same_separators) {
  const auto box = tests::make_box({9, 8, 7}, {1, 1, 1}, 2);
  const auto nodes = static_cast<std::int32_t>(box.nodes_m.size());
  const Graph graph = make_node_graph(box.tets, 10, nodes);
  const CompressedGraph of_elements(box.tets, 10, nodes);
  ASSERT_EQ(of_elements.numbers(), CompressedGraph(graph).numbers());
  EXPECT_EQ(of_elements.expand_sides(separate(of_elements.core(), 1, 0, of_elements.dominated_per_edge())), separate(graph, 1));
}

TEST(CompressedGraph, handles_hard_graphs) {
  std::set<std::pair<std::int32_t, std::int32_t>> clique, star, path;
  for (std::int32_t a = 0; a < 12; ++a)
    for (std::int32_t b = a + 1; b < 12; ++b) {
      clique.emplace(a, b);
      if (a == 0) star.emplace(a, b);
      if (b == a + 1) path.emplace(a, b);
    }
  for (const auto& edges : {clique, star, path, {}}) expect_core_of_definition(make_graph(12, edges));
  EXPECT_EQ(CompressedGraph(make_graph(12, clique), 1).core().vertex_count(), 1);
  EXPECT_EQ(CompressedGraph(make_graph(12, star), 1).core().vertex_count(), 1);
  EXPECT_EQ(CompressedGraph(make_graph(12, path), 1).core().vertex_count(), 12) << "10 is not worthwhile";
  EXPECT_EQ(CompressedGraph(make_graph(12, {}), 1).core().vertex_count(), 12);
  const Graph few = make_graph(12, clique);
  EXPECT_EQ(CompressedGraph(few).core().neighbours, few.neighbours) << "too few to be cut";
  const Graph none;
  EXPECT_EQ(CompressedGraph(none).core().vertex_count(), 0);
  EXPECT_TRUE(CompressedGraph(none).expand_order({}).empty());
  for (const auto& edges : {clique, star, path, {}}) {
    const Vertices order = order_nested_dissection(make_graph(12, edges));
    EXPECT_EQ(std::set<std::int32_t>(order.begin(), order.end()).size(), 12U);
  }
}

TEST(CompressedGraph, of_second_order_keeps_the_corners_and_separates) {
  const std::array<int, 3> cells{8, 7, 6};
  const Graph graph = make_t10_graph(cells);
  const CompressedGraph compressed(graph);
  // Without the eight corners of the box: a node in one cell only is dominated by an end of the cell's diagonal.
  EXPECT_EQ(compressed.core().vertex_count(), (cells[0] + 1) * (cells[1] + 1) * (cells[2] + 1) - 8);
  EXPECT_EQ(find_tries(compressed.core(), compressed.dominated_per_edge()), 4);
  const Vertices side = separate(graph);
  std::array<int, 3> counts{};
  for (std::int32_t v = 0; v < graph.vertex_count(); ++v) {
    ++counts[side[v]];
    for (std::int32_t k = graph.offsets[v]; k < graph.offsets[v + 1]; ++k) {
      const std::int32_t to = side[graph.neighbours[k]];
      EXPECT_TRUE(side[v] == 2 || to != 1 - side[v]);
    }
  }
  EXPECT_GT(counts[0], graph.vertex_count() / 4);
  EXPECT_GT(counts[1], graph.vertex_count() / 4);
  EXPECT_LE(counts[2], 1.3 * (2 * cells[1] + 1) * (2 * cells[2] + 1)) << "a plane of nodes across the shorter sides";
}

TEST(CompressedGraph, predicts_the_operations_of_an_elimination) {
  const Graph graph = make_t10_graph({5, 4, 4});
  const CompressedGraph compressed(graph, 1);
  Vertices position(compressed.core().vertex_count());
  std::iota(position.begin(), position.end(), 0);
  std::vector<Vertices> orders(3, position);
  for (unsigned k = 0; k < 3; ++k) std::shuffle(orders[k].begin(), orders[k].end(), std::mt19937(k));
  orders.push_back(order_nested_dissection(compressed.core()));
  const auto estimate = [&](const Vertices& one) { return predict_operations(compressed.core(), compressed.dominated_per_edge(), one); };
  std::vector<double> counted;
  for (const Vertices& one : orders) {
    counted.push_back(count_factor_operations(graph, compressed.expand_order(one)));
    EXPECT_GT(estimate(one), counted.back()) << "vertices eliminated at a position count with all its rows";
    EXPECT_LT(estimate(one), 2 * counted.back());
  }
  for (std::size_t k = 0; k < 3; ++k) EXPECT_GT(estimate(orders[k]), 2 * estimate(orders[3]));
}

/// METIS on all vertices.
Vertices order_all(const Graph& graph) {
  Graph copy = graph;
  idx_t count = graph.vertex_count();
  Vertices at(count);
  Vertices position(at);
  MetisOptions options = make_metis_options();
  call_metis("METIS_NodeND", [&] {
    return METIS_NodeND(&count, copy.offsets.data(), copy.neighbours.data(), nullptr, options.data(), at.data(), position.data());
  });
  return position;
}

TEST(CompressedGraph, gives_an_order_with_hardly_more_entries_than_one_of_all_vertices) {
  for (const auto& cells : {std::array{8, 8, 8}, std::array{40, 6, 1}, std::array{3, 3, 30}}) {
    const Graph graph = make_t10_graph(cells);
    const double ratio = static_cast<double>(count_factor_entries(graph, order_nested_dissection(graph))) /
                         static_cast<double>(count_factor_entries(graph, order_all(graph)));
    RecordProperty("entries_over_metis", std::to_string(ratio));
    EXPECT_LT(ratio, 1.15) << cells[0] << " x " << cells[1] << " x " << cells[2];
  }
}

}  // namespace
}  // namespace carillon::partition
