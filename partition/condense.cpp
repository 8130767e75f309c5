// Method:     Who dominates a vertex is among the neighbours of its neighbour with the fewest; each candidate is compared row by row. A
// vertex
//             that is dominated at all is dominated by one of the core, as domination is transitive; the vertices of the core that dominate
//             it are neighbours of each other, so no separator has them on two sides.
// Source:     George and Liu 1989, "The evolution of the minimum degree ordering algorithm" (who may wait when neighbourhoods contain each
//             other); Barmak and Minian 2012 (dominated vertices).
// Deviations: none.
#include "partition/condense.hpp"

#include <algorithm>
#include <numeric>
#include <span>

namespace carillon::partition {
namespace {

using Ints = std::vector<std::int32_t>;

std::span<const std::int32_t> list_neighbours(const Graph& graph, std::int32_t vertex) {
  const auto v = static_cast<std::size_t>(vertex);
  const std::int32_t first = graph.offsets[v];
  return {graph.neighbours.data() + first, static_cast<std::size_t>(graph.offsets[v + 1] - first)};
}

/// All that dominate each vertex, in compressed rows.
class Dominators {
 public:
  explicit Dominators(const Graph& graph) : graph_(graph), is_near_(static_cast<std::size_t>(graph.vertex_count()), 0) {
    for (std::int32_t v = 0; v < graph.vertex_count(); ++v) {
      add(v);
      offsets.push_back(static_cast<std::int32_t>(list.size()));
    }
  }

  Ints offsets{0};
  Ints list;

 private:
  void add(std::int32_t v) {
    const auto near = list_neighbours(graph_, v);
    if (near.empty()) return;
    const std::int32_t least = *std::min_element(near.begin(), near.end(), [&](std::int32_t a, std::int32_t b) {
      return list_neighbours(graph_, a).size() < list_neighbours(graph_, b).size();
    });
    mark(v, 1);
    if (may_dominate(least, v)) list.push_back(least);
    for (const std::int32_t u : list_neighbours(graph_, least))
      if (u != v && is_near_[static_cast<std::size_t>(u)] != 0 && may_dominate(u, v)) list.push_back(u);
    mark(v, 0);
  }

  void mark(std::int32_t v, char value) {
    for (const std::int32_t u : list_neighbours(graph_, v)) is_near_[static_cast<std::size_t>(u)] = value;
  }

  /// The neighbours of v are marked.
  bool may_dominate(std::int32_t u, std::int32_t v) const {
    const auto near = list_neighbours(graph_, u);
    const std::size_t count = list_neighbours(graph_, v).size();
    if (near.size() < count || (near.size() == count && u > v)) return false;
    std::size_t common = 1;  // v
    for (const std::int32_t w : near) common += static_cast<std::size_t>(is_near_[static_cast<std::size_t>(w)]);
    return common == count;
  }

  const Graph& graph_;
  std::vector<char> is_near_;
};

}  // namespace

Condensation::Condensation(const Graph& graph, std::int32_t smallest_core)
    : graph_(graph), number_(static_cast<std::size_t>(graph.vertex_count()), -1) {
  Dominators all(graph);
  std::int32_t count = 0;
  for (std::size_t v = 0; v < number_.size(); ++v)
    if (all.offsets[v] == all.offsets[v + 1]) number_[v] = count++;
  if (count < smallest_core || count == graph.vertex_count()) {
    std::iota(number_.begin(), number_.end(), 0);
    offsets_.assign(number_.size() + 1, 0);
    core_ = graph;
    return;
  }
  for (std::size_t v = 0; v < number_.size(); ++v) {
    for (std::int32_t k = all.offsets[v]; k < all.offsets[v + 1]; ++k) {
      const std::int32_t host = number_[static_cast<std::size_t>(all.list[static_cast<std::size_t>(k)])];
      if (host >= 0) hosts_.push_back(host);
    }
    offsets_.push_back(static_cast<std::int32_t>(hosts_.size()));
  }
  core_.offsets = {0};
  for (std::int32_t v = 0; v < graph.vertex_count(); ++v) {
    if (number_[static_cast<std::size_t>(v)] < 0) continue;
    for (const std::int32_t u : list_neighbours(graph, v))
      if (number_[static_cast<std::size_t>(u)] >= 0) core_.neighbours.push_back(number_[static_cast<std::size_t>(u)]);
    core_.offsets.push_back(static_cast<std::int32_t>(core_.neighbours.size()));
  }
}

Ints Condensation::expand_sides(const Ints& side) const {
  Ints result(number_.size(), 2);
  for (std::size_t v = 0; v < number_.size(); ++v) {
    if (number_[v] >= 0) result[v] = side[static_cast<std::size_t>(number_[v])];
    for (std::int32_t k = offsets_[v]; k < offsets_[v + 1]; ++k)
      result[v] = std::min(result[v], side[static_cast<std::size_t>(hosts_[static_cast<std::size_t>(k)])]);
  }
  return result;
}

Ints Condensation::expand_order(const Ints& position) const {
  // By the place of the first host, those that it dominates before it.
  std::vector<Ints> dominated(position.size());
  Ints last(position.size());
  for (std::size_t v = 0; v < number_.size(); ++v) {
    if (number_[v] >= 0) {
      last[static_cast<std::size_t>(position[static_cast<std::size_t>(number_[v])])] = static_cast<std::int32_t>(v);
      continue;
    }
    auto first = static_cast<std::int32_t>(position.size());
    for (std::int32_t k = offsets_[v]; k < offsets_[v + 1]; ++k)
      first = std::min(first, position[static_cast<std::size_t>(hosts_[static_cast<std::size_t>(k)])]);
    dominated[static_cast<std::size_t>(first)].push_back(static_cast<std::int32_t>(v));
  }
  Ints result(number_.size());
  std::int32_t next = 0;
  for (std::size_t place = 0; place < position.size(); ++place) {
    Ints& before = dominated[place];
    std::stable_sort(before.begin(), before.end(),
                     [&](std::int32_t a, std::int32_t b) { return list_neighbours(graph_, a).size() < list_neighbours(graph_, b).size(); });
    for (const std::int32_t v : before) result[static_cast<std::size_t>(v)] = next++;
    result[static_cast<std::size_t>(last[place])] = next++;
  }
  return result;
}

}  // namespace carillon::partition
