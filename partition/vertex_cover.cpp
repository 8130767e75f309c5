// Method: Maximum matching by augmenting paths; the cover follows from alternating walks from unmatched left vertices.
// Source: Koenig 1931; Pothen, Simon, Liou 1990, Partitioning sparse matrices with eigenvectors of graphs (vertex from edge separators).
#include "partition/vertex_cover.hpp"

#include <algorithm>

namespace carillon::partition {
namespace {

using Ints = std::vector<std::int32_t>;

/// Edges between two sides: links from left to right vertices.
struct Bipartite {
  Ints left;
  Ints right;
  std::vector<Ints> links;
};

Bipartite make_bipartite(const std::vector<std::pair<std::int32_t, std::int32_t>>& edges) {
  Bipartite graph;
  for (const auto& [a, b] : edges) {
    graph.left.push_back(a);
    graph.right.push_back(b);
  }
  for (Ints* side : {&graph.left, &graph.right}) {
    std::sort(side->begin(), side->end());
    side->erase(std::unique(side->begin(), side->end()), side->end());
  }
  const auto find = [](const Ints& side, std::int32_t node) {
    return static_cast<std::int32_t>(std::lower_bound(side.begin(), side.end(), node) - side.begin());
  };
  graph.links.resize(graph.left.size());
  for (const auto& [a, b] : edges) graph.links[find(graph.left, a)].push_back(find(graph.right, b));
  return graph;
}

/// Walks from the left vertices `front` along free and matched edges alternately. reached_from: (right) preceding left vertex, -1: not
/// reached. Stops at a right vertex without a partner and returns it; -1 if there is none. `visited` lists the reached vertices.
std::int32_t walk(const Bipartite& graph, const Ints& partner_of_right, Ints front, Ints& reached_from, Ints& visited) {
  for (std::size_t i = 0; i < front.size(); ++i)
    for (const std::int32_t r : graph.links[front[i]]) {
      if (reached_from[r] >= 0) continue;
      reached_from[r] = front[i];
      visited.push_back(r);
      if (partner_of_right[r] < 0) return r;
      front.push_back(partner_of_right[r]);
    }
  return -1;
}

}  // namespace

std::vector<std::int32_t> cover_edges(const std::vector<std::pair<std::int32_t, std::int32_t>>& edges) {
  const Bipartite graph = make_bipartite(edges);
  Ints partner_of_left(graph.left.size(), -1);
  Ints partner_of_right(graph.right.size(), -1);
  Ints reached_from(graph.right.size(), -1);
  Ints visited;
  for (std::int32_t l = 0; l < static_cast<std::int32_t>(graph.left.size()); ++l) {
    visited.clear();
    for (std::int32_t r = walk(graph, partner_of_right, {l}, reached_from, visited); r >= 0;) {
      const std::int32_t from = reached_from[r];
      partner_of_right[r] = from;
      std::swap(partner_of_left[from], r);  // the vertex that loses its partner takes the preceding one
      if (from == l) break;
    }
    for (const std::int32_t r : visited) reached_from[r] = -1;
  }
  // The cover consists of the right vertices reached from unmatched left vertices, and the left vertices not reached.
  Ints unmatched;
  for (std::int32_t l = 0; l < static_cast<std::int32_t>(graph.left.size()); ++l)
    if (partner_of_left[l] < 0) unmatched.push_back(l);
  (void)walk(graph, partner_of_right, unmatched, reached_from, visited);
  Ints cover;
  for (std::size_t r = 0; r < graph.right.size(); ++r) {
    if (reached_from[r] >= 0) cover.push_back(graph.right[r]);
    if (reached_from[r] < 0 && partner_of_right[r] >= 0) cover.push_back(graph.left[partner_of_right[r]]);
  }
  std::sort(cover.begin(), cover.end());
  return cover;
}

}  // namespace carillon::partition
