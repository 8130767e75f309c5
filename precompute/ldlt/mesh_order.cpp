// Method: The graph of the nodes is gathered from the elements by the owners of the nodes, unless rank 0 has all of both; order, fronts and
// mapping are those of a factorisation. The nodes of an element form a clique, so their fronts lie on one path to the root, and the rank of
// the first owns, or shares, all of them.
// Source: Pothen and Sun 1993 (subtrees to ranks); the order: order.cpp.
#include "precompute/ldlt/mesh_order.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "precompute/comm/exchange.hpp"
#include "precompute/ldlt/lists.hpp"
#include "precompute/ldlt/tile_map.hpp"

namespace carillon::ldlt {
namespace {

using comm::Communicator;
using comm::IndexPartition;

/// Links of the own nodes, from elements on any rank. Collective.
NodeLinks gather_links(const Communicator& comm, std::span<const std::int32_t> elements, int width, const IndexPartition& owners) {
  const auto received = comm::all_to_all(comm, [&] {
    std::vector<Ints> lists(comm.size());
    std::vector<int> ranks;
    for (std::size_t at = 0; at < elements.size(); at += static_cast<std::size_t>(width)) {
      const auto nodes = elements.subspan(at, width);
      ranks.clear();
      for (const std::int32_t node : nodes)
        if (node >= 0) ranks.push_back(owners.find_owner(node));
      std::sort(ranks.begin(), ranks.end());
      ranks.erase(std::unique(ranks.begin(), ranks.end()), ranks.end());
      for (const int rank : ranks) lists[rank].insert(lists[rank].end(), nodes.begin(), nodes.end());
    }
    return join(lists);
  });
  return comm.agree([&] {
    NodeLinks links;
    links.first_node = static_cast<std::int32_t>(owners.own_begin());
    links.own_nodes = static_cast<std::int32_t>(owners.own_count());
    const auto is_own = [&](std::int32_t node) { return node >= links.first_node && node < links.first_node + links.own_nodes; };
    for (const std::int32_t node : received.items)
      if (node >= 0 && !is_own(node)) links.ghosts.push_back(node);
    std::sort(links.ghosts.begin(), links.ghosts.end());
    links.ghosts.erase(std::unique(links.ghosts.begin(), links.ghosts.end()), links.ghosts.end());
    Ints local = received.items;
    for (std::int32_t& node : local)
      if (node >= 0) node = is_own(node) ? node - links.first_node : links.find_ghost(node);
    partition::Graph graph = partition::make_node_graph(local, width, links.count());
    graph.offsets.resize(links.own_nodes + 1);
    graph.neighbours.resize(graph.offsets.back());
    links.links = {std::move(graph.offsets), std::move(graph.neighbours)};
    return links;
  });
}

Elimination eliminate(const Communicator& comm, std::span<const std::int32_t> elements, int width, const IndexPartition& owners) {
  const std::int64_t elsewhere = comm.sum(comm.is_root() ? std::int64_t{0} : static_cast<std::int64_t>(elements.size()));
  if (elsewhere == 0 && owners.begin(1) == owners.total() && owners.total() <= partition::kLargestGathered)
    return eliminate_elements(comm, elements, width, static_cast<std::int32_t>(owners.own_count()));
  return eliminate_on_paper(comm, gather_links(comm, elements, width, owners), owners);
}

/// Eliminating ranks of the nodes held by this rank.
std::vector<comm::Reported<std::int32_t>> list_ranks(const MappedFronts& fronts) {
  std::vector<comm::Reported<std::int32_t>> list;
  const Elimination& all = fronts.elimination;
  for (std::size_t h = 0; h < all.parts.size(); ++h) {
    const HeldPart& held = all.parts[h];
    const TreePart& part = all.tree[held.part];
    for (std::size_t s = 0; s < held.forest.supernodes.size(); ++s) {
      const Supernode& front = held.forest.supernodes[s];
      const Ints::const_iterator nodes = held.nodes.begin() + (front.first - part.first);
      if (fronts.owners[h][s] >= 0) {
        for (std::int32_t k = 0; k < front.width; ++k) list.push_back({nodes[k], fronts.owners[h][s]});
        continue;
      }
      const std::int32_t at = fronts.shared.find(part.first_front + static_cast<std::int32_t>(s));
      const TileMap map(front.width, static_cast<std::int32_t>(front.rows.size()), fronts.shared.mapping.list_shares(at));
      for (std::int32_t k = 0; k < front.width; ++k) {
        const int tile = map.find_tile(k);
        list.push_back({nodes[k], map.rank(map.owner(tile, tile))});
      }
    }
  }
  return list;
}

}  // namespace

MeshOrder::MeshOrder(const Communicator& comm, std::span<const std::int32_t> elements, int width, const IndexPartition& owners)
    : owners_(owners), fronts_(map_fronts(comm, eliminate(comm, elements, width, owners))) {
  rank_ = comm::report_to_owners<std::int32_t>(
      comm, [&] { return list_ranks(fronts_); }, owners_, -1);
}

const MappedFronts& MeshOrder::get_fronts() const {
  if (!is_numbered_) throw std::logic_error("the rows of the mesh order are not numbered yet");
  return fronts_;
}

ElementRanks MeshOrder::find_ranks(const Communicator& comm, std::span<const std::int32_t> elements, int width) const {
  if (is_numbered_) throw std::logic_error("find_ranks() must be called before the rows are numbered");
  struct Place {
    std::int32_t position, rank;
  };
  const auto find_own = [&](std::int32_t node) {
    const std::size_t own = owners_.to_local(node);
    return Place{fronts_.elimination.position[own], rank_[own]};
  };
  const Ints foreign = comm.agree([&] {
    Ints list;
    for (const std::int32_t node : elements)
      if (node >= 0 && !owners_.is_own(node)) list.push_back(node);
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
    return list;
  });
  const std::vector<Place> places = comm::query_owners<Place>(
      comm, foreign, [&](std::int32_t node) { return owners_.find_owner(node); }, find_own);
  const auto find_place = [&](std::int32_t node) {
    if (owners_.is_own(node)) return find_own(node);
    return places[std::lower_bound(foreign.begin(), foreign.end(), node) - foreign.begin()];
  };
  return comm.agree([&] {
    ElementRanks ranks;
    for (std::size_t at = 0; at < elements.size(); at += static_cast<std::size_t>(width)) {
      Place first{0, -1};
      for (const std::int32_t node : elements.subspan(at, width)) {
        if (node < 0) continue;
        const Place place = find_place(node);
        if (first.rank < 0 || place.position < first.position) first = place;
      }
      ranks.rank.push_back(first.rank);
      ranks.position.push_back(first.position);
    }
    return ranks;
  });
}

void MeshOrder::renumber(const Communicator& comm, const Ints& row) {
  if (is_numbered_) throw std::logic_error("the rows of a mesh order are already numbered");
  const Ints asked = comm.agree([&] {
    Ints nodes;
    for (const HeldPart& held : fronts_.elimination.parts) nodes.insert(nodes.end(), held.nodes.begin(), held.nodes.end());
    return nodes;
  });
  const Ints rows = comm::query_owners<std::int32_t>(
      comm, asked, [&](std::int32_t node) { return owners_.find_owner(node); },
      [&](std::int32_t node) { return row[owners_.to_local(node)]; });
  auto next = rows.begin();
  for (HeldPart& held : fronts_.elimination.parts)
    for (std::int32_t& node : held.nodes) node = *next++;
  fronts_.elimination.position = {};  // of the old numbers
  rank_ = {};
  is_numbered_ = true;
}

}  // namespace carillon::ldlt
