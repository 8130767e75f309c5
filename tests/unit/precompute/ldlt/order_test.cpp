// Elimination order and fronts against elimination by sets, on any number of ranks.
#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <vector>

#include "partition/partition.hpp"
#include "precompute/comm/exchange.hpp"
#include "precompute/ldlt/elimination.hpp"
#include "precompute/petsc/session.hpp"
#include "tests/support/box_mesh.hpp"

namespace carillon::ldlt {
namespace {

using comm::Communicator;
using comm::IndexPartition;

/// `copies` separate blocks of nx x ny x nz nodes with 26 neighbours each.
std::vector<Ints> make_block(std::int32_t nx, std::int32_t ny, std::int32_t nz, std::int32_t copies) {
  std::vector<Ints> links;
  for (std::int32_t copy = 0; copy < copies; ++copy)
    for (std::int32_t v = 0; v < nx * ny * nz; ++v) {
      Ints& near = links.emplace_back();
      for (std::int32_t z = v / nx / ny - 1; z <= v / nx / ny + 1; ++z)
        for (std::int32_t y = v / nx % ny - 1; y <= v / nx % ny + 1; ++y)
          for (std::int32_t x = v % nx - 1; x <= v % nx + 1; ++x) {
            const std::int32_t u = x + nx * (y + ny * z);
            if (x >= 0 && x < nx && y >= 0 && y < ny && z >= 0 && z < nz && u != v) near.push_back(copy * nx * ny * nz + u);
          }
    }
  return links;
}

/// All data of a front, on every rank.
struct Known {
  std::int32_t first = 0;
  std::int32_t width = 0;
  std::int32_t parent = -1;
  Ints rows;
};

class Case {
 public:
  /// Rows are contiguous per rank; the first rank has none if `is_first_empty`.
  Case(const std::vector<Ints>& graph, std::int32_t largest_gathered, bool is_first_empty = false)
      : graph_(graph), comm_(PETSC_COMM_WORLD) {
    const auto total = static_cast<std::int64_t>(graph.size());
    const int ranks = comm_.size() - (is_first_empty && comm_.size() > 1 ? 1 : 0);
    const int place = comm_.rank() - (comm_.size() - ranks);
    NodeLinks nodes;
    nodes.first_node = place < 0 ? 0 : static_cast<std::int32_t>(total * place / ranks);
    nodes.own_nodes = place < 0 ? 0 : static_cast<std::int32_t>(total * (place + 1) / ranks) - nodes.first_node;
    std::set<std::int32_t> ghosts;
    const auto is_own = [&](std::int32_t u) { return u >= nodes.first_node && u < nodes.first_node + nodes.own_nodes; };
    for (std::int32_t v = 0; v < nodes.own_nodes; ++v)
      for (const std::int32_t u : graph[nodes.first_node + v])
        if (!is_own(u)) ghosts.insert(u);
    nodes.ghosts.assign(ghosts.begin(), ghosts.end());
    for (std::int32_t v = 0; v < nodes.own_nodes; ++v) {
      Ints near;
      for (const std::int32_t u : graph[nodes.first_node + v]) near.push_back(is_own(u) ? u - nodes.first_node : nodes.find_ghost(u));
      std::sort(near.begin(), near.end());
      nodes.links.items.insert(nodes.links.items.end(), near.begin(), near.end());
      nodes.links.close();
    }
    take(eliminate_on_paper(comm_, nodes, IndexPartition(comm_, nodes.own_nodes), largest_gathered), nodes.own_nodes);
  }

  /// Rank 0 has all elements; graph: their links.
  Case(const std::vector<Ints>& graph, const Ints& elements, int width) : graph_(graph), comm_(PETSC_COMM_WORLD) {
    const auto nodes = comm_.is_root() ? static_cast<std::int32_t>(graph.size()) : 0;
    take(eliminate_elements(comm_, comm_.is_root() ? elements : Ints(), width, nodes), nodes);
  }

  int ranks() const { return comm_.size(); }
  const Ints& position() const { return position_; }

  void expect_every_node_once() const {
    Ints sorted = position_;
    std::sort(sorted.begin(), sorted.end());
    for (std::size_t v = 0; v < sorted.size(); ++v) ASSERT_EQ(sorted[v], static_cast<std::int32_t>(v)) << "positions are not a permutation";
    ASSERT_EQ(nodes_of_fronts_.size(), graph_.size()) << "each node is a pivot of one front";
    for (std::size_t k = 0; k < nodes_of_fronts_.size(); ++k)
      EXPECT_EQ(position_[nodes_of_fronts_[k]], places_of_nodes_[k]) << "holder and owner disagree";
  }

  /// Eliminates node by node, with sets.
  void expect_fronts_hold_the_fill() const {
    std::vector<std::set<std::int32_t>> behind(graph_.size());
    for (std::size_t v = 0; v < graph_.size(); ++v)
      for (const std::int32_t u : graph_[v])
        if (position_[u] > position_[v]) behind[position_[v]].insert(position_[u]);
    for (std::set<std::int32_t>& column : behind) {
      if (column.empty()) continue;
      std::set<std::int32_t>& next = behind[*column.begin()];
      next.insert(std::next(column.begin()), column.end());
    }
    for (std::size_t f = 0; f < fronts_.size(); ++f) {
      const Known& front = fronts_[f];
      ASSERT_TRUE(std::is_sorted(front.rows.begin(), front.rows.end()));
      for (std::int32_t p = front.first; p < front.first + front.width; ++p)
        for (const std::int32_t row : behind[p])
          ASSERT_TRUE(row < front.first + front.width || std::binary_search(front.rows.begin(), front.rows.end(), row))
              << "row " << row << " of pivot " << p << " is missing";
      const std::set<std::int32_t>& last = behind[front.first + front.width - 1];
      EXPECT_EQ(front.rows, Ints(last.begin(), last.end())) << "rows of a front differ from those of its last pivot";
      if (front.rows.empty()) {
        EXPECT_EQ(front.parent, -1);
        continue;
      }
      ASSERT_GT(front.parent, static_cast<std::int32_t>(f)) << "children must precede parents";
      const Known& parent = fronts_[front.parent];
      EXPECT_GE(front.rows.front(), parent.first);
      EXPECT_LT(front.rows.front(), parent.first + parent.width);
      for (const std::int32_t row : front.rows)
        EXPECT_TRUE(row < parent.first + parent.width || std::binary_search(parent.rows.begin(), parent.rows.end(), row));
    }
  }

  double count_operations() const {
    double operations = 0;
    for (const Known& front : fronts_) operations += count_flops(front.width, front.width + static_cast<std::int64_t>(front.rows.size()));
    return operations;
  }

 private:
  /// Gathers the data of all ranks on every rank. Collective.
  void take(const Elimination& all, std::int32_t own_nodes) {
    position_ = comm_.all_gather(Ints(all.position.begin(), all.position.begin() + own_nodes));
    Ints packed;
    for (const HeldPart& held : all.parts)
      for (std::size_t s = 0; s < held.forest.supernodes.size(); ++s) {
        const Supernode& node = held.forest.supernodes[s];
        packed.insert(packed.end(), {all.tree.parts[held.part].first_front + static_cast<std::int32_t>(s), node.first, node.width,
                                     held.parents[s], static_cast<std::int32_t>(node.rows.size())});
        packed.insert(packed.end(), node.rows.begin(), node.rows.end());
        for (std::int32_t k = 0; k < node.width; ++k) {
          const TreePart& part = all.tree.parts[held.part];
          nodes_of_fronts_.push_back(held.nodes[node.first - part.first + k]);
          places_of_nodes_.push_back(node.first + k);
        }
      }
    nodes_of_fronts_ = comm_.all_gather(nodes_of_fronts_);
    places_of_nodes_ = comm_.all_gather(places_of_nodes_);
    packed = comm_.all_gather(packed);
    fronts_.resize(all.tree.fronts);
    for (std::size_t at = 0; at < packed.size();) {
      Known& front = fronts_[packed[at]];
      front.first = packed[at + 1];
      front.width = packed[at + 2];
      front.parent = packed[at + 3];
      const auto rows = packed.begin() + static_cast<std::ptrdiff_t>(at) + 5;
      front.rows.assign(rows, rows + packed[at + 4]);
      at += 5 + static_cast<std::size_t>(packed[at + 4]);
    }
  }

  const std::vector<Ints>& graph_;
  Communicator comm_;
  Ints position_;  // (nodes)
  Ints nodes_of_fronts_, places_of_nodes_;
  std::vector<Known> fronts_;
};

constexpr std::int32_t kAll = 300'000;

TEST(order, holds_every_node_once_and_the_fill_of_its_elimination) {
  const std::vector<Ints> graph = make_block(9, 8, 7, 1);
  const Case whole(graph, kAll);
  whole.expect_every_node_once();
  whole.expect_fronts_hold_the_fill();
}

// A piece too large to be gathered is cut by its quotient graph, as a mesh of many million nodes is.
TEST(order, the_same_where_no_rank_may_gather_the_graph) {
  const std::vector<Ints> graph = make_block(16, 12, 10, 1);
  const Case whole(graph, kAll);
  for (const std::int32_t largest : {0, 300, 1000}) {
    const Case cut(graph, largest);
    cut.expect_every_node_once();
    cut.expect_fronts_hold_the_fill();
    EXPECT_LE(cut.count_operations(), 2.5 * whole.count_operations()) << largest;
  }
}

TEST(order, the_same_for_a_body_in_pieces_and_ranks_without_rows) {
  for (const std::int32_t copies : {1, 7, 50}) {
    const std::vector<Ints> graph = make_block(3, 2, 2, copies);
    for (const std::int32_t largest : {0, 40, kAll})
      for (const bool is_first_empty : {false, true}) {
        const Case body(graph, largest, is_first_empty);
        body.expect_every_node_once();
        body.expect_fronts_hold_the_fill();
      }
  }
}

TEST(order, the_same_for_fewer_nodes_than_ranks) {
  for (const std::int32_t nodes : {1, 2, 5}) {
    const std::vector<Ints> graph = make_block(nodes, 1, 1, 1);
    const Case few(graph, kAll);
    few.expect_every_node_once();
    few.expect_fronts_hold_the_fill();
  }
}

/// Links of a graph as lists.
std::vector<Ints> list_links(const partition::Graph& graph) {
  std::vector<Ints> links;
  for (std::int32_t v = 0; v < graph.vertex_count(); ++v)
    links.emplace_back(graph.list_neighbours(v).begin(), graph.list_neighbours(v).end());
  return links;
}

// Rank 0 compresses the graph, and links nodes of an element only to its first eliminated node.
TEST(order, the_same_from_elements_as_from_the_links_of_all_their_nodes) {
  Ints pairs;  // elements of two nodes and a gap; no node dominates another
  for (std::int32_t v = 0; v < 20; ++v) pairs.insert(pairs.end(), {v, -1, (v + 1) % 20});
  Ints apart = {0, 1, 2, 3, 4, 5, 6, 7, -1, -1, -1, -1};  // node 8 is in no element
  const mesh::TetMesh t10 = tests::make_box({7, 5, 4}, {1, 1, 1}, 2);
  Ints fixed = t10.tets;  // without the first face
  for (std::int32_t& node : fixed) node -= 300;
  const auto count_nodes = [](const Ints& elements) { return *std::max_element(elements.begin(), elements.end()) + 1; };
  struct Body {
    const Ints& elements;
    int width;
    std::int32_t nodes;
  };
  for (const auto& [elements, width, nodes] : {Body{pairs, 3, 20}, Body{apart, 4, 9}, Body{t10.tets, 10, count_nodes(t10.tets)},
                                               Body{fixed, 10, count_nodes(fixed)}, Body{apart, 1, 9}}) {
    const partition::Graph graph = partition::make_node_graph(elements, width, nodes);
    const std::vector<Ints> links = list_links(graph);
    const Case body(links, elements, width);
    body.expect_every_node_once();
    body.expect_fronts_hold_the_fill();
    if (body.ranks() > 1) continue;  // parts are not merged
    double operations = 0;
    for (const Supernode& front : find_supernodes(partition::renumber(graph, body.position()), 0, nodes).supernodes)
      operations += count_flops(front.width, front.size());
    EXPECT_DOUBLE_EQ(body.count_operations(), operations) << "fronts differ from those of the whole graph in this order";
  }
}

TEST(order, from_elements_costs_hardly_more_than_from_links) {
  const mesh::TetMesh box = tests::make_box({12, 9, 8}, {1, 1, 1}, 2);
  const auto nodes = static_cast<std::int32_t>(box.nodes_m.size());
  const std::vector<Ints> links = list_links(partition::make_node_graph(box.tets, 10, nodes));
  EXPECT_LE(Case(links, box.tets, 10).count_operations(), 1.1 * Case(links, kAll).count_operations());
}

}  // namespace
}  // namespace carillon::ldlt
