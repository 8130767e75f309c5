// Method:     A part that one rank can hold is cut by METIS's vertex separator, the best of four. A larger one is cut into clusters by
//             METIS k-way; their quotient graph, weighted by vertices and edges, is bisected by METIS (the best of eight cuts), and the
//             edges cut are covered by the fewest vertices: the separator. Leaves and separators are ordered by METIS. Sides may be a fifth
//             apart: a small separator is worth more, for work is balanced later, when it is known.
// Source:     George 1973; Karypis and Kumar 1998; Koenig 1931 (vertex_cover.cpp).
// Deviations: covers are not refined.
#include "partition/dissect.hpp"

#include <algorithm>
#include <array>
#include <numeric>
#include <utility>

#include "partition/metis.hpp"
#include "partition/vertex_cover.hpp"

namespace carillon::partition {
namespace {

using Ints = std::vector<std::int32_t>;

constexpr std::int32_t kClusters = 1024;  // with 4,096 one cut of the bunny in 64 parts was so bad that it doubled the operations
constexpr idx_t kSeparators = 4;
constexpr idx_t kCuts = 8;
constexpr idx_t kImbalance = 200;  // thousandths

Ints make_clusters(const Graph& graph, std::int32_t count) {
  Ints cluster(static_cast<std::size_t>(graph.vertex_count()), 0);
  if (count <= 1 || graph.neighbours.empty()) return cluster;
  MetisOptions options = make_metis_options();
  Graph copy = graph;
  idx_t vertices = graph.vertex_count();
  idx_t constraints = 1;
  idx_t cut = 0;
  check_metis(METIS_PartGraphKway(&vertices, &constraints, copy.offsets.data(), copy.neighbours.data(), nullptr, nullptr, nullptr, &count,
                                  nullptr, nullptr, options.data(), &cut, cluster.data()),
              "METIS_PartGraphKway");
  return cluster;
}

class Dissector {
 public:
  Dissector(const Graph& graph, std::int32_t largest_gathered)
      : graph_(graph), largest_gathered_(largest_gathered), side_(static_cast<std::size_t>(graph.vertex_count()), -1), number_(side_) {
    cluster_ = make_clusters(graph, graph.vertex_count() <= largest_gathered ? 1 : std::min(kClusters, graph.vertex_count() / 4));
    place_of_cluster_.assign(static_cast<std::size_t>(cluster_.empty() ? 0 : *std::max_element(cluster_.begin(), cluster_.end()) + 1), -1);
    result_.position.assign(static_cast<std::size_t>(graph.vertex_count()), 0);
  }

  Dissection run(int parts) {
    Ints all(static_cast<std::size_t>(graph_.vertex_count()));
    std::iota(all.begin(), all.end(), 0);
    cut(all, parts);
    return std::move(result_);
  }

 private:
  void cut(const Ints& vertices, int parts) {
    if (parts <= 1) {
      place(vertices);
      return;
    }
    const int left_parts = parts / 2;
    if (static_cast<std::int32_t>(vertices.size()) <= largest_gathered_) {
      separate(vertices);
    } else {
      halve(vertices, static_cast<float>(left_parts) / static_cast<float>(parts));
      for (const std::int32_t v : cover_edges(list_cut_edges(vertices))) side_[v] = 2;
    }
    std::array<Ints, 3> sides;
    for (const std::int32_t v : vertices) sides[static_cast<std::size_t>(side_[v])].push_back(v);
    for (const std::int32_t v : vertices) side_[v] = -1;
    cut(sides[0], left_parts);
    cut(sides[1], parts - left_parts);
    place(sides[2]);
    result_.separator.push_back(static_cast<std::int32_t>(sides[2].size()));
  }

  /// side_: 0, 1 or 2, the separator, for each of the vertices.
  void separate(const Ints& vertices) {
    Graph inner = take(vertices);
    MetisOptions options = make_metis_options();
    options[METIS_OPTION_NSEPS] = kSeparators;
    options[METIS_OPTION_UFACTOR] = kImbalance;
    idx_t count = inner.vertex_count();
    idx_t size = 0;
    Ints side(vertices.size(), 0);
    if (!inner.neighbours.empty())
      check_metis(
          METIS_ComputeVertexSeparator(&count, inner.offsets.data(), inner.neighbours.data(), nullptr, options.data(), &size, side.data()),
          "METIS_ComputeVertexSeparator");
    else
      for (std::size_t i = 0; i < side.size(); ++i) side[i] = 2 * i < side.size() ? 0 : 1;
    for (std::size_t i = 0; i < vertices.size(); ++i) side_[vertices[i]] = side[i];
  }

  /// side_: 0 or 1 for each of the vertices.
  void halve(const Ints& vertices, float left) {
    Ints clusters;
    for (const std::int32_t v : vertices)
      if (place_of_cluster_[cluster_[v]] < 0) {
        place_of_cluster_[cluster_[v]] = static_cast<std::int32_t>(clusters.size());
        clusters.push_back(cluster_[v]);
      }
    Ints side(clusters.size(), 0);
    if (clusters.size() > 1) bisect_clusters(vertices, clusters.size(), left, side);
    for (const std::int32_t v : vertices) side_[v] = side[place_of_cluster_[cluster_[v]]];
    for (const std::int32_t c : clusters) place_of_cluster_[c] = -1;
  }

  void bisect_clusters(const Ints& vertices, std::size_t count, float left, Ints& side) {
    Ints weight(count, 0);
    std::vector<std::pair<std::int32_t, std::int32_t>> links;
    for (const std::int32_t v : vertices) number_[v] = place_of_cluster_[cluster_[v]];
    for (const std::int32_t v : vertices) {
      ++weight[number_[v]];
      for (std::int32_t k = graph_.offsets[v]; k < graph_.offsets[v + 1]; ++k) {
        const std::int32_t to = number_[graph_.neighbours[k]];
        if (to >= 0 && to != number_[v]) links.emplace_back(number_[v], to);
      }
    }
    for (const std::int32_t v : vertices) number_[v] = -1;
    std::sort(links.begin(), links.end());
    Ints offsets(1, 0);
    Ints neighbours;
    Ints edges;
    std::size_t at = 0;
    for (std::int32_t c = 0; c < static_cast<std::int32_t>(count); ++c) {
      while (at < links.size() && links[at].first == c) {
        const std::size_t first = at;
        while (at < links.size() && links[at] == links[first]) ++at;
        neighbours.push_back(links[first].second);
        edges.push_back(static_cast<std::int32_t>(at - first));
      }
      offsets.push_back(static_cast<std::int32_t>(neighbours.size()));
    }
    MetisOptions options = make_metis_options();
    options[METIS_OPTION_NCUTS] = kCuts;
    options[METIS_OPTION_UFACTOR] = kImbalance;
    auto clusters = static_cast<idx_t>(count);
    idx_t constraints = 1;
    idx_t halves = 2;
    idx_t cut = 0;
    std::array<real_t, 2> shares{left, 1 - left};
    check_metis(METIS_PartGraphRecursive(&clusters, &constraints, offsets.data(), neighbours.data(), weight.data(), nullptr, edges.data(),
                                         &halves, shares.data(), nullptr, options.data(), &cut, side.data()),
                "METIS_PartGraphRecursive");
  }

  std::vector<std::pair<std::int32_t, std::int32_t>> list_cut_edges(const Ints& vertices) const {
    std::vector<std::pair<std::int32_t, std::int32_t>> edges;
    for (const std::int32_t v : vertices)
      for (std::int32_t k = graph_.offsets[v]; side_[v] == 0 && k < graph_.offsets[v + 1]; ++k)
        if (side_[graph_.neighbours[k]] == 1) edges.emplace_back(v, graph_.neighbours[k]);
    return edges;
  }

  /// The graph of these vertices alone, in their order.
  Graph take(const Ints& vertices) {
    Graph inner;
    inner.offsets.push_back(0);
    for (std::size_t i = 0; i < vertices.size(); ++i) number_[vertices[i]] = static_cast<std::int32_t>(i);
    for (const std::int32_t v : vertices) {
      for (std::int32_t k = graph_.offsets[v]; k < graph_.offsets[v + 1]; ++k)
        if (number_[graph_.neighbours[k]] >= 0) inner.neighbours.push_back(number_[graph_.neighbours[k]]);
      inner.offsets.push_back(static_cast<std::int32_t>(inner.neighbours.size()));
    }
    for (const std::int32_t v : vertices) number_[v] = -1;
    return inner;
  }

  /// The next places of the order, by nested dissection among these vertices.
  void place(const Ints& vertices) {
    const Ints order = order_nested_dissection(take(vertices));
    for (std::size_t i = 0; i < vertices.size(); ++i) result_.position[vertices[i]] = placed_ + order[i];
    placed_ += static_cast<std::int32_t>(vertices.size());
  }

  const Graph& graph_;
  std::int32_t largest_gathered_ = 0;
  Ints cluster_;           // (vertices)
  Ints place_of_cluster_;  // (clusters) among those at hand, -1: not there
  Ints side_;              // (vertices) -1: not at hand
  Ints number_;            // (vertices) scratch, -1 between uses
  std::int32_t placed_ = 0;
  Dissection result_;
};

}  // namespace

Dissection dissect(const Graph& graph, int parts, std::int32_t largest_gathered) { return Dissector(graph, largest_gathered).run(parts); }

}  // namespace carillon::partition
