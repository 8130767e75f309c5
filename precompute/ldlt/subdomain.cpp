// Method:     The nodes of a rank that are not in the separator have all their neighbours on the rank or in the separator, so they are
//             ordered by METIS and eliminated on paper without a message; the separator is their boundary and stands behind them.
// Source:     George 1973, Nested dissection of a regular finite element mesh; Karypis and Kumar 1998 (METIS).
// Deviations: none.
#include "precompute/ldlt/subdomain.hpp"

#include <algorithm>

#include "precompute/petsc/session.hpp"
#include "runtime/base/error.hpp"

namespace carillon::ldlt {
namespace {

using partition::Graph;

Ints list_ghost_nodes(const NodeRows& k, const NodeRows& m) {
  Ints nodes;
  for (const NodeRows* rows : {&k, &m})
    for (PetscInt g = 0; g < rows->ghost_count(); ++g) nodes.push_back(rows->ghosts()[g] / 3);
  std::sort(nodes.begin(), nodes.end());
  nodes.erase(std::unique(nodes.begin(), nodes.end()), nodes.end());
  return nodes;
}

Graph make_subdomain_graph(const NodeLinks& nodes, const Ints& number, std::int32_t count) {
  Graph graph;
  graph.offsets.reserve(static_cast<std::size_t>(count) + 1);
  graph.offsets.push_back(0);
  for (std::int32_t v = 0; v < nodes.own_nodes; ++v) {
    if (number[v] < 0 || number[v] >= count) continue;
    for (const std::int32_t* u = nodes.links.begin(v); u != nodes.links.end(v); ++u)
      if (*u < nodes.own_nodes && number[*u] >= 0 && number[*u] < count) graph.neighbours.push_back(number[*u]);
    graph.offsets.push_back(static_cast<std::int32_t>(graph.neighbours.size()));
  }
  return graph;
}

/// The same graph in order of elimination, with the boundary behind it. number: (own and ghost nodes) in the new order.
Graph make_eliminated_graph(const NodeLinks& nodes, const Ints& number, std::int32_t subdomain, std::int32_t boundary) {
  Ints node_at(subdomain, -1);
  std::vector<Ints> inward(boundary);
  for (std::int32_t v = 0; v < nodes.own_nodes; ++v)
    if (number[v] >= 0 && number[v] < subdomain) node_at[number[v]] = v;
  Graph graph;
  graph.offsets.push_back(0);
  for (std::int32_t i = 0; i < subdomain; ++i) {
    const std::int32_t v = node_at[i];
    for (const std::int32_t* u = nodes.links.begin(v); u != nodes.links.end(v); ++u) {
      graph.neighbours.push_back(number[*u]);
      if (number[*u] >= subdomain) inward[number[*u] - subdomain].push_back(i);
    }
    graph.offsets.push_back(static_cast<std::int32_t>(graph.neighbours.size()));
  }
  for (const Ints& list : inward) {
    graph.neighbours.insert(graph.neighbours.end(), list.begin(), list.end());
    graph.offsets.push_back(static_cast<std::int32_t>(graph.neighbours.size()));
  }
  return graph;
}

}  // namespace

NodeLinks find_links(const NodeRows& k, const NodeRows& m) {
  NodeLinks nodes;
  nodes.first_node = k.first_row() / 3;
  nodes.own_nodes = k.rows() / 3;
  nodes.ghosts = list_ghost_nodes(k, m);
  Ints mark(static_cast<std::size_t>(nodes.own_nodes) + nodes.ghosts.size(), -1);
  for (const NodeRows* rows : {&k, &m})
    if (rows->rows() != 3 * nodes.own_nodes || rows->first_row() != 3 * nodes.first_node)
      throw InputError("K and M of a factorisation must have the same rows on each rank, whole nodes of three.");
  const auto find_ghost = [&](PetscInt column) {
    return nodes.own_nodes +
           static_cast<std::int32_t>(std::lower_bound(nodes.ghosts.begin(), nodes.ghosts.end(), column / 3) - nodes.ghosts.begin());
  };
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
            [&](PetscInt column, double) { add(find_ghost(rows->ghosts()[column])); });
    std::sort(nodes.links.items.begin() + nodes.links.offsets.back(), nodes.links.items.end());
    nodes.links.close();
  }
  return nodes;
}

Separator gather_separator(MPI_Comm comm, const NodeLinks& nodes, const Ints& rank_starts, std::vector<bool>& is_separator) {
  const auto global = [&](std::int32_t v) { return v < nodes.own_nodes ? nodes.first_node + v : nodes.ghosts[v - nodes.own_nodes]; };
  Ragged edges;
  comm::Communicator(comm).agree([&] {
    for (std::int32_t v = 0; v < nodes.own_nodes; ++v) {
      Ints higher;
      for (const std::int32_t* u = nodes.links.begin(v); u != nodes.links.end(v); ++u)
        if (global(*u) >= nodes.first_node + nodes.own_nodes) higher.push_back(global(*u));
      if (higher.empty()) continue;
      edges.items.push_back(global(v));
      edges.items.insert(edges.items.end(), higher.begin(), higher.end());
      edges.close();
    }
  });
  Separator separator;
  find_separator(comm, edges, rank_starts, separator);
  Ragged links;
  Ragged near;
  comm::Communicator(comm).agree([&] {
    is_separator.assign(static_cast<std::size_t>(nodes.own_nodes) + nodes.ghosts.size(), false);
    for (std::int32_t v = 0; v < nodes.own_nodes; ++v) is_separator[v] = separator.find(global(v)) >= 0;
    for (std::size_t g = 0; g < nodes.ghosts.size(); ++g)
      is_separator[static_cast<std::size_t>(nodes.own_nodes) + g] = separator.find(nodes.ghosts[g]) >= 0;

    for (std::int32_t v = 0; v < nodes.own_nodes; ++v) {
      if (!is_separator[v]) continue;
      Ints ranks;
      for (const std::int32_t* u = nodes.links.begin(v); u != nodes.links.end(v); ++u) {
        const std::int32_t node = global(*u);
        if (is_separator[*u]) {
          links.items.push_back(separator.find(node));
        } else {
          ranks.push_back(find_rank(rank_starts, node));
        }
      }
      std::sort(ranks.begin(), ranks.end());
      ranks.erase(std::unique(ranks.begin(), ranks.end()), ranks.end());
      near.items.insert(near.items.end(), ranks.begin(), ranks.end());
      links.close();
      near.close();
    }
  });
  separator.links = gather_ragged(comm, links, separator.first_of_rank);
  separator.adjacent_ranks = gather_ragged(comm, near, separator.first_of_rank);
  comm::Communicator(comm).agree([&] { order_separator(separator); });
  return separator;
}

Subdomain plan_subdomain(const NodeLinks& nodes, const Separator& separator, const std::vector<bool>& is_separator) {
  Subdomain subdomain;
  Ints number(is_separator.size(), -1);
  Ints members;
  for (std::int32_t v = 0; v < nodes.own_nodes; ++v)
    if (!is_separator[v]) {
      number[v] = static_cast<std::int32_t>(members.size());
      members.push_back(v);
    }
  const auto count = static_cast<std::int32_t>(members.size());
  const auto find_position = [&](std::int32_t v) {
    return separator.position[separator.find(v < nodes.own_nodes ? nodes.first_node + v : nodes.ghosts[v - nodes.own_nodes])];
  };
  for (const std::int32_t v : members)
    for (const std::int32_t* u = nodes.links.begin(v); u != nodes.links.end(v); ++u)
      if (is_separator[*u]) subdomain.boundary.push_back(find_position(*u));
  std::sort(subdomain.boundary.begin(), subdomain.boundary.end());
  subdomain.boundary.erase(std::unique(subdomain.boundary.begin(), subdomain.boundary.end()), subdomain.boundary.end());

  Ints place = partition::order_nested_dissection(make_subdomain_graph(nodes, number, count));
  for (const std::int32_t v : members) number[v] = place[number[v]];
  for (std::size_t v = 0; v < number.size(); ++v) {
    if (!is_separator[v]) continue;
    const auto at = std::lower_bound(subdomain.boundary.begin(), subdomain.boundary.end(), find_position(static_cast<std::int32_t>(v)));
    number[v] = count + static_cast<std::int32_t>(at - subdomain.boundary.begin());
  }
  subdomain.forest =
      find_supernodes(make_eliminated_graph(nodes, number, count, static_cast<std::int32_t>(subdomain.boundary.size())), 0, count);
  subdomain.own_node.resize(count);
  for (const std::int32_t v : members) subdomain.own_node[subdomain.forest.position[number[v]]] = v;
  return subdomain;
}

}  // namespace carillon::ldlt
