// Method: A part that one rank can hold is compressed (compress.cpp) and cut by the vertex separator of METIS, best of four. A larger one
// is divided into clusters by METIS k-way; their quotient graph, weighted by vertices and edges, is bisected by METIS (best of eight cuts),
// and a minimum vertex cover of the cut edges is the separator. Leaves and separators are ordered by METIS. Sides may differ by a fifth: a
// small separator is worth more, as work is balanced later. Covers are not refined.
// Source: George 1973; Karypis and Kumar 1998; Koenig 1931 (vertex_cover.cpp).
#include "partition/dissect.hpp"

#include <algorithm>
#include <array>
#include <numeric>
#include <utility>

#include "partition/compress.hpp"
#include "partition/metis.hpp"
#include "partition/vertex_cover.hpp"

namespace carillon::partition {
namespace {

using Ints = std::vector<std::int32_t>;

constexpr std::int32_t kClusters = 1024;  // with 4,096 one cut of the bunny in 64 parts doubled the operations
constexpr idx_t kCuts = 8;
constexpr idx_t kImbalance = 200;  // per thousand

class Dissector {
 public:
  Dissector(const Graph& graph, std::int32_t largest_gathered)
      : graph_(graph), largest_gathered_(largest_gathered), side_(static_cast<std::size_t>(graph.vertex_count()), -1), number_(side_) {
    cluster_ = make_clusters(graph, graph.vertex_count() <= largest_gathered ? 1 : std::min(kClusters, graph.vertex_count() / 4));
    place_of_cluster_.assign(cluster_.empty() ? 0 : *std::max_element(cluster_.begin(), cluster_.end()) + 1, -1);
    result_.position.assign(graph.vertex_count(), 0);
  }

  Dissection run(int parts) {
    Ints all(graph_.vertex_count());
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
      const Ints side = separate(take_part(graph_, vertices, number_));
      for (std::size_t i = 0; i < vertices.size(); ++i) side_[vertices[i]] = side[i];
    } else {
      halve_clusters(vertices, static_cast<double>(left_parts) / parts);
      for (const std::int32_t v : cover_edges(list_cut_edges(vertices))) side_[v] = 2;
    }
    std::array<Ints, 3> sides;
    for (const std::int32_t v : vertices) sides[side_[v]].push_back(v);
    for (const std::int32_t v : vertices) side_[v] = -1;
    cut(sides[0], left_parts);
    cut(sides[1], parts - left_parts);
    place(sides[2]);
    result_.separator.push_back(static_cast<std::int32_t>(sides[2].size()));
  }

  /// Sets side_ to 0 or 1 for each of the vertices.
  void halve_clusters(const Ints& vertices, double left) {
    Ints clusters;
    for (const std::int32_t v : vertices)
      if (place_of_cluster_[cluster_[v]] < 0) {
        place_of_cluster_[cluster_[v]] = static_cast<std::int32_t>(clusters.size());
        clusters.push_back(cluster_[v]);
      }
    const Ints side = halve(make_quotient(vertices, clusters.size()), left);
    for (const std::int32_t v : vertices) side_[v] = side[place_of_cluster_[cluster_[v]]];
    for (const std::int32_t c : clusters) place_of_cluster_[c] = -1;
  }

  WeightedGraph make_quotient(const Ints& vertices, std::size_t count) {
    WeightedGraph quotient;
    quotient.weights.assign(count, 0);
    std::vector<std::pair<std::int32_t, std::int32_t>> links;
    for (const std::int32_t v : vertices) number_[v] = place_of_cluster_[cluster_[v]];
    for (const std::int32_t v : vertices) {
      ++quotient.weights[number_[v]];
      for (std::int32_t k = graph_.offsets[v]; k < graph_.offsets[v + 1]; ++k) {
        const std::int32_t to = number_[graph_.neighbours[k]];
        if (to >= 0 && to != number_[v]) links.emplace_back(number_[v], to);
      }
    }
    for (const std::int32_t v : vertices) number_[v] = -1;
    std::sort(links.begin(), links.end());
    std::size_t at = 0;
    for (std::int32_t c = 0; c < static_cast<std::int32_t>(count); ++c) {
      while (at < links.size() && links[at].first == c) {
        const std::size_t first = at;
        while (at < links.size() && links[at] == links[first]) ++at;
        quotient.graph.neighbours.push_back(links[first].second);
        quotient.links.push_back(static_cast<std::int32_t>(at - first));
      }
      quotient.graph.offsets.push_back(static_cast<std::int32_t>(quotient.graph.neighbours.size()));
    }
    return quotient;
  }

  std::vector<std::pair<std::int32_t, std::int32_t>> list_cut_edges(const Ints& vertices) const {
    std::vector<std::pair<std::int32_t, std::int32_t>> edges;
    for (const std::int32_t v : vertices)
      for (std::int32_t k = graph_.offsets[v]; side_[v] == 0 && k < graph_.offsets[v + 1]; ++k)
        if (side_[graph_.neighbours[k]] == 1) edges.emplace_back(v, graph_.neighbours[k]);
    return edges;
  }

  /// Orders these vertices by nested dissection and appends them to the order.
  void place(const Ints& vertices) {
    const Ints order = order_nested_dissection(take_part(graph_, vertices, number_));
    for (std::size_t i = 0; i < vertices.size(); ++i) result_.position[vertices[i]] = placed_ + order[i];
    placed_ += static_cast<std::int32_t>(vertices.size());
  }

  const Graph& graph_;
  std::int32_t largest_gathered_ = 0;
  Ints cluster_;           // (vertices)
  Ints place_of_cluster_;  // (clusters) index among those of the current part, -1: none
  Ints side_;              // (vertices) -1: not in the current part
  Ints number_;            // (vertices) scratch, -1 between uses
  std::int32_t placed_ = 0;
  Dissection result_;
};

Ints separate_core(Graph core, double dominated_per_edge, int tries, int seed) {
  Ints side(core.vertex_count(), 0);
  if (core.neighbours.empty()) {
    for (std::size_t v = 0; v < side.size(); ++v) side[v] = 2 * v < side.size() ? 0 : 1;
    return side;
  }
  MetisOptions options = make_metis_options();
  options[METIS_OPTION_NSEPS] = tries * find_tries(core, dominated_per_edge);
  options[METIS_OPTION_SEED] += seed;
  options[METIS_OPTION_UFACTOR] = kImbalance;
  idx_t count = core.vertex_count();
  idx_t size = 0;
  call_metis("METIS_ComputeVertexSeparator", [&] {
    return METIS_ComputeVertexSeparator(&count, core.offsets.data(), core.neighbours.data(), nullptr, options.data(), &size, side.data());
  });
  return side;
}

}  // namespace

std::vector<std::int32_t> separate(const Graph& graph, int tries, int seed, std::optional<double> dominated_per_edge) {
  if (dominated_per_edge) return separate_core(graph, *dominated_per_edge, tries, seed);
  const CompressedGraph compressed(graph);
  return compressed.expand_sides(separate_core(compressed.core(), compressed.dominated_per_edge(), tries, seed));
}

std::vector<std::int32_t> make_clusters(const Graph& graph, std::int32_t count) {
  Ints cluster(graph.vertex_count(), 0);
  if (count <= 1 || graph.neighbours.empty()) return cluster;
  MetisOptions options = make_metis_options();
  Graph copy = graph;
  idx_t vertices = graph.vertex_count();
  idx_t constraints = 1;
  idx_t cut = 0;
  call_metis("METIS_PartGraphKway", [&] {
    return METIS_PartGraphKway(&vertices, &constraints, copy.offsets.data(), copy.neighbours.data(), nullptr, nullptr, nullptr, &count,
                               nullptr, nullptr, options.data(), &cut, cluster.data());
  });
  return cluster;
}

std::vector<std::int32_t> halve(const WeightedGraph& graph, double left) {
  WeightedGraph copy = graph;
  Ints side(graph.weights.size(), 0);
  if (side.size() < 2) return side;
  MetisOptions options = make_metis_options();
  options[METIS_OPTION_NCUTS] = kCuts;
  options[METIS_OPTION_UFACTOR] = kImbalance;
  auto count = static_cast<idx_t>(side.size());
  idx_t constraints = 1;
  idx_t halves = 2;
  idx_t cut = 0;
  std::array<real_t, 2> shares{static_cast<real_t>(left), static_cast<real_t>(1 - left)};
  call_metis("METIS_PartGraphRecursive", [&] {
    return METIS_PartGraphRecursive(&count, &constraints, copy.graph.offsets.data(), copy.graph.neighbours.data(), copy.weights.data(),
                                    nullptr, copy.links.data(), &halves, shares.data(), nullptr, options.data(), &cut, side.data());
  });
  return side;
}

Dissection dissect(const Graph& graph, int parts, std::int32_t largest_gathered) { return Dissector(graph, largest_gathered).run(parts); }

}  // namespace carillon::partition
