// Method: A dominator of v is a neighbour of every neighbour of v. Candidates are the common neighbours of two neighbours of v with few
// neighbours that are not adjacent; each candidate is compared row by row. In a mesh, a dominator is a node of all elements of v. Each
// dominated vertex is dominated by a core vertex, as domination is transitive; the core vertices that dominate it are adjacent, so no
// separator has them on both sides.
// Source: George and Liu 1989, "The evolution of the minimum degree ordering algorithm" (postponed elimination by outmatching); Barmak and
// Minian 2012 (dominated vertices); Liu 1990, "The role of elimination trees in sparse factorization".
#include "partition/compress.hpp"

#include <algorithm>
#include <numeric>
#include <span>
#include <utility>

namespace carillon::partition {
namespace {

using Ints = std::vector<std::int32_t>;

/// All dominators of each vertex, in compressed rows.
class Dominators {
 public:
  explicit Dominators(const Graph& graph) : graph_(graph), mark_(static_cast<std::size_t>(graph.vertex_count()), 0) {
    for (std::int32_t v = 0; v < graph.vertex_count(); ++v) {
      add(v);
      offsets.push_back(static_cast<std::int32_t>(list.size()));
    }
  }

  Ints offsets{0};
  Ints list;

 private:
  void add(std::int32_t v) {
    const auto near = graph_.list_neighbours(v);
    if (near.empty()) return;
    for (const std::int32_t u : near) mark(u) = 1;
    const std::int32_t first = find_least(near, 1);
    mark(first) = 2;
    for (const std::int32_t u : graph_.list_neighbours(first)) mark(u) *= 2;
    // A dominator of v is adjacent to the first neighbour, and to a second one that is not adjacent to the first: few vertices are.
    const std::int32_t second = find_least(near, 1);
    if (second < 0) {
      for (const std::int32_t u : near)
        if (may_dominate(u, v)) list.push_back(u);
    } else {
      for (const std::int32_t u : graph_.list_neighbours(second))
        if (mark(u) == 2 && may_dominate(u, v)) list.push_back(u);
    }
    for (const std::int32_t u : near) mark(u) = 0;
  }

  char& mark(std::int32_t vertex) { return mark_[vertex]; }
  /// Vertex with this mark and the fewest neighbours; -1: none.
  std::int32_t find_least(std::span<const std::int32_t> vertices, char wanted) {
    std::int32_t least = -1;
    std::size_t fewest = 0;
    for (const std::int32_t u : vertices) {
      if (mark(u) != wanted) continue;
      const std::size_t count = graph_.list_neighbours(u).size();
      if (least >= 0 && count >= fewest) continue;
      least = u;
      fewest = count;
    }
    return least;
  }

  /// Requires exactly the neighbours of v to be marked.
  bool may_dominate(std::int32_t u, std::int32_t v) const {
    const auto near = graph_.list_neighbours(u);
    const std::size_t count = graph_.list_neighbours(v).size();
    if (near.size() < count || (near.size() == count && u > v)) return false;
    std::size_t common = 1;  // v
    for (const std::int32_t w : near) common += mark_[w] != 0 ? 1 : 0;
    return common == count;
  }

  const Graph& graph_;
  std::vector<char> mark_;  // (vertices) 1: a neighbour of v; 2: the first neighbour, or also adjacent to it
};

/// All nodes that are in every element of a node, in compressed rows; of two nodes in the same elements only the lower-numbered dominates
/// the other.
class ElementDominators {
 public:
  ElementDominators(std::span<const std::int32_t> elements, int width, const ElementLists& lists)
      : elements_(elements), width_(static_cast<std::size_t>(width)), lists_(lists), shared_(lists.begin.size() - 1, 0) {
    for (std::int32_t v = 0; v < static_cast<std::int32_t>(shared_.size()); ++v) {
      if (!lists.of(v).empty()) add(v);
      offsets.push_back(static_cast<std::int32_t>(list.size()));
    }
  }

  Ints offsets{0};
  Ints list;

 private:
  void add(std::int32_t v) {
    const auto of_v = lists_.of(v);
    std::int32_t before = 0;  // elements of v
    for (const std::int32_t e : of_v) {
      for (const std::int32_t u : get(e))
        if (u >= 0) shared_[u] += shared_[u] == before ? 1 : 0;
      ++before;
    }
    for (const std::int32_t u : get(of_v.front())) {
      if (u < 0) continue;
      const std::size_t count = lists_.of(u).size();
      if (std::exchange(shared_[u], 0) == before && u != v && (count > of_v.size() || u < v)) list.push_back(u);
    }
  }
  std::span<const std::int32_t> get(std::int32_t e) const { return elements_.subspan(static_cast<std::size_t>(e) * width_, width_); }

  std::span<const std::int32_t> elements_;
  std::size_t width_;
  const ElementLists& lists_;
  Ints shared_;  // (nodes) number of elements of v that contain the node, counted while it is in all of them so far
};

}  // namespace

CompressedGraph::CompressedGraph(const Graph& graph, std::int32_t smallest_core)
    : number_(static_cast<std::size_t>(graph.vertex_count()), -1) {
  for (std::int32_t v = 0; v < graph.vertex_count(); ++v) degree_.push_back(static_cast<std::int32_t>(graph.list_neighbours(v).size()));
  const Dominators all(graph);
  const Ints kept = choose_core(all.offsets, all.list, smallest_core);
  Ints scratch(number_.size(), -1);
  core_ = kept.empty() ? graph : take_part(graph, kept, scratch);
}

CompressedGraph::CompressedGraph(std::span<const std::int32_t> elements, int width, std::int32_t nodes, std::int32_t smallest_core)
    : number_(static_cast<std::size_t>(nodes), -1) {
  const ElementLists lists = list_elements(elements, width, nodes);
  for (std::int32_t v = 0; v < nodes; ++v) degree_.push_back(static_cast<std::int32_t>(lists.of(v).size()));
  const ElementDominators all(elements, width, lists);
  const Ints kept = choose_core(all.offsets, all.list, smallest_core);
  if (kept.empty()) {
    core_ = make_node_graph(elements, width, nodes);
    return;
  }
  Ints of_core(elements.begin(), elements.end());
  for (std::int32_t& node : of_core)
    if (node >= 0) node = number_[node];
  core_ = make_node_graph(of_core, width, static_cast<std::int32_t>(kept.size()));
}

Ints CompressedGraph::choose_core(const Ints& offsets, const Ints& dominators, std::int32_t smallest_core) {
  Ints kept;
  for (std::size_t v = 0; v < number_.size(); ++v) {
    if (offsets[v] < offsets[v + 1]) continue;
    number_[v] = static_cast<std::int32_t>(kept.size());
    kept.push_back(static_cast<std::int32_t>(v));
  }
  if (static_cast<std::int32_t>(kept.size()) < smallest_core || 2 * kept.size() > number_.size()) {
    std::iota(number_.begin(), number_.end(), 0);
    offsets_.assign(number_.size() + 1, 0);
    return {};
  }
  for (std::size_t v = 0; v < number_.size(); ++v) {
    for (std::int32_t k = offsets[v]; k < offsets[v + 1]; ++k) {
      const std::int32_t host = number_[dominators[k]];
      if (host >= 0) hosts_.push_back(host);
    }
    offsets_.push_back(static_cast<std::int32_t>(hosts_.size()));
  }
  return kept;
}

double CompressedGraph::dominated_per_edge() const {
  const auto dominated = static_cast<double>(number_.size()) - core_.vertex_count();
  return core_.neighbours.empty() ? 0 : dominated / (0.5 * static_cast<double>(core_.neighbours.size()));
}

Ints CompressedGraph::expand_sides(const Ints& side) const {
  Ints result(number_.size(), 2);
  for (std::size_t v = 0; v < number_.size(); ++v) {
    if (number_[v] >= 0) result[v] = side[number_[v]];
    for (std::int32_t k = offsets_[v]; k < offsets_[v + 1]; ++k) result[v] = std::min(result[v], side[hosts_[k]]);
  }
  return result;
}

/// Position of the first core vertex that dominates this vertex.
std::int32_t CompressedGraph::find_first_host(std::int32_t vertex, const Ints& position) const {
  auto first = static_cast<std::int32_t>(position.size());
  for (std::int32_t k = offsets_[vertex]; k < offsets_[vertex + 1]; ++k) first = std::min(first, position[hosts_[k]]);
  return first;
}

Ints CompressedGraph::expand_order(const Ints& position) const {
  // Grouped by the position of the first dominator, dominated vertices before it.
  std::vector<Ints> dominated(position.size());
  Ints last(position.size());
  for (std::size_t v = 0; v < number_.size(); ++v) {
    if (number_[v] >= 0) {
      last[position[number_[v]]] = static_cast<std::int32_t>(v);
      continue;
    }
    dominated[find_first_host(static_cast<std::int32_t>(v), position)].push_back(static_cast<std::int32_t>(v));
  }
  Ints result(number_.size());
  std::int32_t next = 0;
  for (std::size_t place = 0; place < position.size(); ++place) {
    Ints& before = dominated[place];
    std::stable_sort(before.begin(), before.end(), [&](std::int32_t a, std::int32_t b) { return degree_[a] < degree_[b]; });
    for (const std::int32_t v : before) result[v] = next++;
    result[last[place]] = next++;
  }
  return result;
}

int find_tries(const Graph& core, double dominated_per_edge) {
  const double dominated = dominated_per_edge * 0.5 * static_cast<double>(core.neighbours.size());
  return dominated >= 3.0 * core.vertex_count() ? 4 : 1;
}

double predict_operations(const Graph& core, double dominated_per_edge, const Ints& position) {
  const std::size_t count = position.size();
  Ints at(count);
  std::vector<double> width(count, 1.0);  // (positions) vertices eliminated there
  for (std::size_t v = 0; v < count; ++v) {
    at[position[v]] = static_cast<std::int32_t>(v);
    for (const std::int32_t u : core.list_neighbours(static_cast<std::int32_t>(v)))
      if (position[u] > position[v]) width[position[v]] += dominated_per_edge;
  }
  // Row by row of the factor: the paths up the elimination tree from the earlier neighbours (Liu 1990).
  std::vector<double> below(count, 0.0);
  Ints parent(count, -1);
  Ints seen_from(count, -1);
  for (std::int32_t row = 0; row < static_cast<std::int32_t>(count); ++row) {
    seen_from[row] = row;
    for (const std::int32_t u : core.list_neighbours(at[row])) {
      if (position[u] > row) continue;
      for (auto place = static_cast<std::size_t>(position[u]); seen_from[place] != row; place = static_cast<std::size_t>(parent[place])) {
        seen_from[place] = row;
        below[place] += width[row];
        if (parent[place] < 0) parent[place] = row;
      }
    }
  }
  double operations = 0;
  for (std::size_t k = 0; k < count; ++k) operations += width[k] * (below[k] + width[k] / 2) * (below[k] + width[k] / 2);
  return operations;
}

}  // namespace carillon::partition
