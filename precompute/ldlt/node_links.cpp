#include "precompute/ldlt/node_links.hpp"

#include <algorithm>

#include "runtime/base/error.hpp"

namespace carillon::ldlt {
namespace {

Ints list_ghost_nodes(const NodeRows& k, const NodeRows& m) {
  Ints nodes;
  for (const NodeRows* rows : {&k, &m})
    for (PetscInt g = 0; g < rows->ghost_count(); ++g) nodes.push_back(rows->ghosts()[g] / 3);
  std::sort(nodes.begin(), nodes.end());
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  return nodes;
}

}  // namespace

std::int32_t NodeLinks::find_ghost(std::int32_t node) const {
  return own_nodes + static_cast<std::int32_t>(std::lower_bound(ghosts.begin(), ghosts.end(), node) - ghosts.begin());
}

NodeLinks find_links(const NodeRows& k, const NodeRows& m) {
  NodeLinks nodes;
  nodes.first_node = k.first_row() / 3;
  nodes.own_nodes = k.rows() / 3;
  nodes.ghosts = list_ghost_nodes(k, m);
  Ints mark(static_cast<std::size_t>(nodes.own_nodes) + nodes.ghosts.size(), -1);
  for (const NodeRows* rows : {&k, &m})
    if (rows->rows() != 3 * nodes.own_nodes || rows->first_row() != 3 * nodes.first_node)
      throw InputError("K and M of a factorisation must have the same rows on each rank, whole nodes of three.");
  for (std::int32_t v = 0; v < nodes.own_nodes; ++v) {
    mark[v] = v;
    const auto add = [&](std::int32_t u) {
      if (mark[u] == v) return;
      mark[u] = v;
      nodes.links.items.push_back(u);
    };
    for (const NodeRows* rows : {&k, &m})
      for (PetscInt i = 3 * v; i < 3 * v + 3; ++i)
        rows->visit(
            i, [&](PetscInt column, double) { add(column / 3); },
            [&](PetscInt column, double) { add(nodes.find_ghost(rows->ghosts()[column] / 3)); });
    std::sort(nodes.links.items.begin() + nodes.links.offsets.back(), nodes.links.items.end());
    nodes.links.close();
  }
  return nodes;
}

}  // namespace carillon::ldlt
