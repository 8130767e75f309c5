// Method: From the leaves up: a leaf or subtree passes the rows of its roots on as elements of the quotient graph, and the holder of the
// separator above eliminates them; so no rank sees more than its parts. Positions start as those of order_parts and change as each part is
// put in postorder; their users query the final ones. If rank 0 has all elements, it compresses the graph, orders the core and expands the
// order to the other nodes. Fronts of different parts are not merged.
// Source: Duff and Reid 1983 (elements of the quotient graph).
#include "precompute/ldlt/elimination.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

#include "partition/compress.hpp"
#include "precompute/comm/exchange.hpp"
#include "precompute/ldlt/lists.hpp"

namespace carillon::ldlt {
namespace {

using comm::Communicator;
using comm::IndexPartition;
using partition::Graph;

// Below this core size all nodes are ordered together: the parts would be too small for METIS, and it takes milliseconds.
constexpr std::int32_t kSmallestCore = 256;
constexpr std::int32_t kAnyNumber = std::numeric_limits<std::int32_t>::max();  // no limit on the nodes of a piece

/// Remainder of an eliminated subtree: the rows of one of its roots, and that front.
struct Element {
  std::int32_t part = 0, supernode = 0;
  Ints rows;  // positions, ascending
};

/// Symbolic elimination of a part. links: for each of its positions the later neighbours. Elements without a row in the part, and the roots
/// of the part, are appended to `left`; `parents` gets the front above each element.
class PartEliminator {
 public:
  PartEliminator(const TreePart& part, HeldPart& held, const Ragged& links, std::vector<Element>& elements)
      : part_(part), held_(held), links_(links), elements_(elements) {}

  /// above: (elements) supernode above each, -1: none in this part.
  std::vector<Element> run(Ints& above) {
    find_boundary();
    const auto hubs = static_cast<std::int32_t>(elements_.size());
    held_.forest = find_supernodes(make_graph(), hubs, part_.count);
    above = held_.forest.element_parents;
    std::vector<Element> left;
    for (std::size_t h = 0; h < elements_.size(); ++h)
      if (above[h] < 0 && !elements_[h].rows.empty()) left.push_back(std::move(elements_[h]));
    Ints ordered(held_.nodes.size());
    for (std::size_t k = 0; k < ordered.size(); ++k) ordered[held_.forest.position[k]] = held_.nodes[k];
    held_.nodes = std::move(ordered);
    for (std::size_t s = 0; s < held_.forest.supernodes.size(); ++s) {
      Supernode& node = held_.forest.supernodes[s];
      node.first += part_.first;
      for (std::int32_t& row : node.rows) row = row < part_.count ? part_.first + row : boundary_[row - part_.count];
      if (node.parent < 0 && !node.rows.empty()) left.push_back({held_.part, static_cast<std::int32_t>(s), node.rows});
    }
    return left;
  }

 private:
  void find_boundary() {
    const std::int32_t behind = part_.first + part_.count;
    for (const std::int32_t to : links_.items)
      if (to >= behind) boundary_.push_back(to);
    for (const Element& element : elements_)
      for (const std::int32_t row : element.rows)
        if (row >= behind) boundary_.push_back(row);
    std::sort(boundary_.begin(), boundary_.end());
    boundary_.erase(std::unique(boundary_.begin(), boundary_.end()), boundary_.end());
  }

  /// Graph of elements, pivots and boundary.
  Graph make_graph() const {
    const auto hubs = static_cast<std::int32_t>(elements_.size());
    const std::int32_t behind = part_.first + part_.count;
    const auto find = [&](std::int32_t position) {
      if (position < behind) return hubs + position - part_.first;
      const auto at = std::lower_bound(boundary_.begin(), boundary_.end(), position) - boundary_.begin();
      return hubs + part_.count + static_cast<std::int32_t>(at);
    };
    // Calls visit(vertex, later neighbour) for each link, by ascending vertex, so that each vertex gets its earlier neighbours first.
    const auto for_links = [&](auto&& visit) {
      for (std::int32_t h = 0; h < hubs; ++h)
        for (const std::int32_t row : elements_[h].rows) visit(h, find(row));
      for (std::int32_t p = 0; p < part_.count; ++p)
        for (const std::int32_t* to = links_.begin(p); to != links_.end(p); ++to) visit(hubs + p, find(*to));
    };
    Graph graph;
    graph.offsets.assign(static_cast<std::size_t>(hubs + part_.count) + boundary_.size() + 1, 0);
    for_links([&](std::int32_t from, std::int32_t to) {
      ++graph.offsets[from + 1];
      ++graph.offsets[to + 1];
    });
    std::partial_sum(graph.offsets.begin(), graph.offsets.end(), graph.offsets.begin());
    graph.neighbours.resize(graph.offsets.back());
    Ints next(graph.offsets.begin(), graph.offsets.end() - 1);
    for_links([&](std::int32_t from, std::int32_t to) {
      graph.neighbours[next[from]++] = to;
      graph.neighbours[next[to]++] = from;
    });
    return graph;
  }

  const TreePart& part_;
  HeldPart& held_;
  const Ragged& links_;
  std::vector<Element>& elements_;
  Ints boundary_;
};

/// Received lists (position, count, later neighbours), one per position held here, as rows of the held parts. Collective.
std::vector<Ragged> sort_links(const Communicator& comm, const Ints& items, const Elimination& all) {
  return comm.agree([&] {
    std::vector<Ragged> links(all.parts.size());
    std::vector<std::vector<std::size_t>> at(all.parts.size());
    std::vector<std::size_t> held_of(all.tree.parts.size(), 0);
    for (std::size_t h = 0; h < all.parts.size(); ++h) {
      at[h].assign(all.tree.parts[all.parts[h].part].count, 0);
      held_of[all.parts[h].part] = h;
    }
    for (ListReader reader(items); !reader.is_at_end();) {
      const std::int32_t position = reader.next();
      const std::size_t part = all.tree.find_part(position);
      at[held_of[part]][position - all.tree.parts[part].first] = reader.place();
      reader.skip(reader.next());
    }
    for (std::size_t h = 0; h < links.size(); ++h)
      for (const std::size_t place : at[h]) {
        const std::int32_t* list = items.data() + place;
        links[h].items.insert(links[h].items.end(), list + 1, list + 1 + *list);
        links[h].close();
      }
    return links;
  });
}

/// Links of the nodes of each held part, by position. Collective.
std::vector<Ragged> send_links(const Communicator& comm, const NodeLinks& nodes, const Elimination& all) {
  const auto received = comm::all_to_all(comm, [&] {
    std::vector<Ints> lists(comm.size());
    for (std::int32_t v = 0; v < nodes.own_nodes; ++v) {
      const std::int32_t position = all.position[v];
      Ints& list = lists[all.tree.find_holder(position)];
      list.insert(list.end(), {position, 0});
      const std::size_t count = list.size() - 1;
      for (const std::int32_t* u = nodes.links.begin(v); u != nodes.links.end(v); ++u)
        if (all.position[*u] > position) list.push_back(all.position[*u]);
      list[count] = static_cast<std::int32_t>(list.size() - count) - 1;
    }
    return join(lists);
  });
  return sort_links(comm, received.items, all);
}

/// Front above each root, both as (part, supernode).
struct Above {
  std::int32_t part, supernode, above_part, above_supernode;
};

std::vector<Above> eliminate_parts(const Communicator& comm, Elimination& all, const std::vector<Ragged>& links) {
  std::vector<Above> found;
  std::vector<Element> elements;  // for the next part
  for (int depth = all.tree.depth(); depth >= 0; --depth) {
    const auto received = comm::all_to_all(comm, [&] {
      std::vector<Ints> lists(comm.size());
      for (std::size_t h = 0; h < all.parts.size(); ++h) {
        HeldPart& held = all.parts[h];
        const TreePart& part = all.tree[held.part];
        if (part.depth != depth) continue;
        Ints above;
        std::vector<Element> arrived = std::exchange(elements, {});
        std::vector<Element> named;
        for (const Element& element : arrived) named.push_back({element.part, element.supernode, {}});
        const std::vector<Element> left = PartEliminator(part, held, links[h], arrived).run(above);
        for (std::size_t k = 0; k < named.size(); ++k)
          if (above[k] >= 0) found.push_back({named[k].part, named[k].supernode, held.part, above[k]});
        for (const Element& element : left) {
          Ints& list = lists[all.tree[part.parent].begin];
          list.insert(list.end(), {element.part, element.supernode, static_cast<std::int32_t>(element.rows.size())});
          list.insert(list.end(), element.rows.begin(), element.rows.end());
        }
      }
      return join(lists);
    });
    comm.agree([&] {
      for (ListReader reader(received.items); !reader.is_at_end();) {
        Element& element = elements.emplace_back();
        element.part = reader.next();
        element.supernode = reader.next();
        element.rows = reader.take(reader.next());
      }
    });
  }
  return found;
}

/// Numbers the fronts and reports the front above each root to its holder. Collective.
void link_parts(const Communicator& comm, Elimination& all, const std::vector<Above>& found) {
  Ints counts(all.tree.parts.size(), 0);
  for (const HeldPart& held : all.parts) counts[held.part] = static_cast<std::int32_t>(held.forest.supernodes.size());
  comm.sum(std::span<std::int32_t>(counts));
  all.tree.fronts = 0;
  for (std::size_t t = 0; t < counts.size(); ++t) {
    all.tree.parts[t].first_front = all.tree.fronts;
    all.tree.fronts += counts[t];
  }
  const auto first_front = [&](std::int32_t part) { return all.tree.parts[part].first_front; };
  const auto reported = comm::all_to_all(comm, found, [&](const Above& one) { return all.tree.parts[one.part].begin; });
  comm.agree([&] {
    for (HeldPart& held : all.parts) {
      held.parents.clear();
      for (const Supernode& node : held.forest.supernodes)
        held.parents.push_back(node.parent < 0 ? -1 : first_front(held.part) + node.parent);
      for (const Above& one : reported.items)
        if (one.part == held.part) held.parents[one.supernode] = first_front(one.above_part) + one.above_supernode;
    }
  });
}

/// Final positions after reordering by the holders of their parts. Collective.
Ints find_moved(const Communicator& comm, const Elimination& all, const Ints& positions) {
  std::vector<const HeldPart*> held_of(all.tree.parts.size(), nullptr);
  for (const HeldPart& held : all.parts) held_of[held.part] = &held;
  return comm::query_owners<std::int32_t>(
      comm, positions, [&](std::int32_t position) { return all.tree.find_holder(position); },
      [&](std::int32_t position) {
        const std::size_t part = all.tree.find_part(position);
        const std::int32_t first = all.tree.parts[part].first;
        return first + held_of[part]->forest.position[position - first];
      });
}

/// Parts of the tree held by this rank, and their nodes. Local.
void hold_parts(const Communicator& comm, Elimination& all, std::vector<Ints> placed) {
  for (std::size_t t = 0; t < placed.size(); ++t) {
    if (all.tree.parts[t].begin != comm.rank()) continue;
    HeldPart& held = all.parts.emplace_back();
    held.part = static_cast<int>(t);
    held.nodes = std::move(placed[t]);
  }
}

/// Positions of own nodes. Collective.
Ints report_own_positions(const Communicator& comm, const Elimination& all, const IndexPartition& owners) {
  return comm::report_to_owners<std::int32_t>(
      comm,
      [&] {
        std::vector<comm::Reported<std::int32_t>> list;
        for (const HeldPart& held : all.parts) {
          std::int32_t at = all.tree[held.part].first;
          for (const std::int32_t node : held.nodes) list.push_back({node, at++});
        }
        return list;
      },
      owners, -1);
}

/// Finds the fronts and reorders positions within their parts. links: of the held parts, as for PartEliminator. Collective.
void find_fronts(const Communicator& comm, Elimination& all, const std::vector<Ragged>& links) {
  link_parts(comm, all, eliminate_parts(comm, all, links));
  const Ints asked = comm.agree([&] {
    Ints rows;
    for (const HeldPart& held : all.parts) {
      const TreePart& part = all.tree[held.part];
      for (const Supernode& node : held.forest.supernodes)
        for (const std::int32_t row : node.rows)
          if (row >= part.first + part.count) rows.push_back(row);
    }
    return rows;
  });
  const Ints known = find_moved(comm, all, asked);
  auto next = known.begin();
  for (HeldPart& held : all.parts) {
    const TreePart& part = all.tree[held.part];
    for (Supernode& node : held.forest.supernodes) {
      for (std::int32_t& row : node.rows)
        if (row >= part.first + part.count) row = *next++;
      std::sort(node.rows.begin(), node.rows.end());
    }
  }
}

/// Nodes in elimination order, for the holder of each part. position: (nodes) on rank 0, empty elsewhere. Local.
std::vector<Ints> list_nodes(const Communicator& comm, const SeparatorTree& tree, const Ints& position) {
  std::vector<Ints> lists(comm.size());
  if (position.empty()) return lists;
  Ints node_at(position.size());
  for (std::size_t v = 0; v < position.size(); ++v) node_at[position[v]] = static_cast<std::int32_t>(v);
  for (const TreePart& part : tree.parts)
    lists[part.begin].insert(lists[part.begin].end(), node_at.begin() + part.first, node_at.begin() + part.first + part.count);
  return lists;
}

/// Links that produce the same fronts as a clique of all nodes of each element: from the first eliminated node of an element to its other
/// nodes. The others then become a clique, so the fill is the same. Lists as for sort_links(). Local.
std::vector<Ints> list_star_links(const Communicator& comm, const SeparatorTree& tree, std::span<const std::int32_t> elements, int width,
                                  const Ints& position) {
  std::vector<Ints> lists(comm.size());
  const std::size_t count = position.size();
  if (count == 0) return lists;
  // Elements by their first node, as linked lists.
  Ints head(count, -1);
  Ints next;
  Ints places(elements.begin(), elements.end());
  for (std::size_t at = 0; at < places.size(); at += static_cast<std::size_t>(width)) {
    auto first = static_cast<std::int32_t>(count);
    for (std::int32_t& place : std::span(places).subspan(at, width)) {
      if (place < 0) continue;
      place = position[place];
      first = std::min(first, place);
    }
    const auto e = static_cast<std::int32_t>(next.size());
    next.push_back(first < static_cast<std::int32_t>(count) ? std::exchange(head[first], e) : -1);
  }
  Ints seen_from(count, -1);
  for (const TreePart& part : tree.parts) {
    Ints& list = lists[part.begin];
    for (std::int32_t p = part.first; p < part.first + part.count; ++p) {
      list.insert(list.end(), {p, 0});
      const std::size_t behind = list.size() - 1;
      seen_from[p] = p;
      for (std::int32_t e = head[p]; e >= 0; e = next[e])
        for (const std::int32_t q : std::span(places).subspan(static_cast<std::size_t>(e) * static_cast<std::size_t>(width), width))
          if (q >= 0 && std::exchange(seen_from[q], p) != p) list.push_back(q);
      list[behind] = static_cast<std::int32_t>(list.size() - behind) - 1;
    }
  }
  return lists;
}

}  // namespace

Ints report_positions(const Communicator& comm, const Elimination& all, const NodeLinks& nodes, const IndexPartition& owners) {
  Ints position = report_own_positions(comm, all, owners);
  const Ints ghosts = fetch_ghosts(comm, nodes, owners, position);
  position.insert(position.end(), ghosts.begin(), ghosts.end());
  return position;
}

Elimination eliminate_on_paper(const Communicator& comm, const NodeLinks& nodes, const IndexPartition& owners,
                               std::int32_t largest_gathered) {
  Elimination all = comm.agree([&] { return Elimination(comm.size()); });
  std::vector<Ints> placed = order_parts(comm, nodes, owners, all.tree, largest_gathered);
  comm.agree([&] { hold_parts(comm, all, std::move(placed)); });
  all.position = report_positions(comm, all, nodes, owners);
  find_fronts(comm, all, send_links(comm, nodes, all));
  all.position = report_positions(comm, all, nodes, owners);
  return all;
}

Elimination eliminate_elements(const Communicator& comm, std::span<const std::int32_t> elements, int width, std::int32_t nodes) {
  Elimination all = comm.agree([&] { return Elimination(comm.size()); });
  const auto compressed = comm.agree([&] { return partition::CompressedGraph(elements, width, nodes, kSmallestCore); });
  NodeLinks core = comm.agree([&] {
    NodeLinks links;
    links.own_nodes = compressed.core().vertex_count();
    links.links = {compressed.core().offsets, compressed.core().neighbours};
    return links;
  });
  const IndexPartition core_owners(comm, core.own_nodes);
  core.first_node = static_cast<std::int32_t>(core_owners.own_begin());
  const double dominated_per_edge = comm.broadcast([&] { return compressed.dominated_per_edge(); });
  std::vector<Ints> placed = order_parts(comm, core, core_owners, all.tree, kAnyNumber, dominated_per_edge);
  comm.agree([&] { hold_parts(comm, all, std::move(placed)); });
  const Ints core_position = report_own_positions(comm, all, core_owners);

  // Rank 0 expands the compressed graph; the parts grow accordingly.
  const Ints position = comm.agree([&] { return compressed.expand_order(core_position); });
  const Ints ends = comm.broadcast([&] {
    Ints end(all.tree.parts.size(), 0);
    for (std::size_t v = 0; v < position.size(); ++v) {
      const std::int32_t number = compressed.numbers()[v];
      if (number < 0) continue;
      const int part = all.tree.find_part(core_position[number]);
      end[part] = std::max(end[part], position[v] + 1);
    }
    return end;
  });
  std::int32_t first = 0;
  for (std::size_t t = 0; t < ends.size(); ++t) {
    TreePart& part = all.tree.parts[t];
    part.first = first;
    first = std::max(first, ends[t]);
    part.count = first - part.first;
  }
  const auto held_nodes = comm::all_to_all(comm, [&] { return join(list_nodes(comm, all.tree, position)); });
  auto next = held_nodes.items.begin();
  comm.agree([&] {
    for (HeldPart& held : all.parts) {
      const std::int32_t count = all.tree[held.part].count;
      held.nodes.assign(next, next + count);
      next += count;
    }
  });
  const auto links = comm::all_to_all(comm, [&] { return join(list_star_links(comm, all.tree, elements, width, position)); });
  find_fronts(comm, all, sort_links(comm, links.items, all));
  all.position = report_own_positions(comm, all, IndexPartition(comm, nodes));
  return all;
}

}  // namespace carillon::ldlt
