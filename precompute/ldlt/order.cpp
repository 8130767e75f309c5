// Method: All nodes start in one piece. While it exceeds the limit of one rank, it is cut by its quotient graph: each rank clusters its own
// nodes, rank 0 bisects the cluster graph down the tree, and for each part the edges between its two sides are covered by a minimum vertex
// cover. Then each piece is gathered and cut by vertex separators, the right half going to another rank, until each rank has a leaf; up to
// four of the ranks below compute a separator each, and the smallest is taken. Leaves and separators are ordered by METIS. The half with
// more of its rows on the left ranks goes left.
// Source: George 1973, Nested dissection of a regular finite element mesh; Karypis and Kumar 1998 (METIS); Koenig 1931 (vertex cover).
#include "precompute/ldlt/order.hpp"

#include <algorithm>
#include <array>
#include <numeric>
#include <utility>

#include "partition/dissect.hpp"
#include "partition/vertex_cover.hpp"
#include "precompute/comm/exchange.hpp"
#include "precompute/ldlt/lists.hpp"

namespace carillon::ldlt {
namespace {

using comm::Communicator;
using comm::IndexPartition;
using partition::Graph;

constexpr std::int32_t kClusters = 1024;      // for all ranks together
constexpr std::int32_t kFewestClusters = 64;  // per rank
constexpr std::size_t kSmallestCut = 8;       // nodes: smaller pieces are not cut
constexpr int kTries = 4;                     // ranks that compute a separator of the same piece

/// Part that contains a node, in its interior or its separator.
struct Label {
  std::int32_t part = 0, is_separator = 0;
  friend bool operator==(const Label&, const Label&) = default;
};

/// Links among the own nodes.
Graph make_own_graph(const NodeLinks& nodes) {
  Graph graph;
  graph.offsets.push_back(0);
  for (std::int32_t v = 0; v < nodes.own_nodes; ++v) {
    for (const std::int32_t* u = nodes.links.begin(v); u != nodes.links.end(v) && *u < nodes.own_nodes; ++u) graph.neighbours.push_back(*u);
    graph.offsets.push_back(static_cast<std::int32_t>(graph.neighbours.size()));
  }
  return graph;
}

struct Link {
  std::int32_t from = 0, to = 0;
  auto operator<=>(const Link&) const = default;
};

/// Part of each cluster: pieces of at most `largest` nodes, or leaves. Links between clusters occur once per link between their nodes.
Ints bisect_clusters(const SeparatorTree& tree, const Ints& weights, std::vector<Link> links, std::int32_t largest) {
  std::sort(links.begin(), links.end());
  Ints place(weights.size(), tree.root());
  Ints number(weights.size(), -1);
  std::vector<int> open{tree.root()};
  while (!open.empty()) {
    const int part = open.back();
    open.pop_back();
    Ints members;
    std::int64_t nodes = 0;
    for (std::size_t c = 0; c < place.size(); ++c)
      if (place[c] == part) {
        number[c] = static_cast<std::int32_t>(members.size());
        members.push_back(static_cast<std::int32_t>(c));
        nodes += weights[c];
      }
    if (nodes > largest && !tree[part].is_leaf() && members.size() > 1) {
      partition::WeightedGraph quotient;
      for (const std::int32_t c : members) {
        quotient.weights.push_back(weights[c]);
        auto at = std::lower_bound(links.begin(), links.end(), Link{c, 0});
        for (; at != links.end() && at->from == c; ++at) {
          const std::int32_t to = number[at->to];
          if (to < 0 || to == number[c]) continue;
          if (static_cast<std::int32_t>(quotient.graph.neighbours.size()) == quotient.graph.offsets.back() ||
              quotient.graph.neighbours.back() != to) {
            quotient.graph.neighbours.push_back(to);
            quotient.links.push_back(0);
          }
          ++quotient.links.back();
        }
        quotient.graph.offsets.push_back(static_cast<std::int32_t>(quotient.graph.neighbours.size()));
      }
      const int left = tree[part].left;
      const double share = static_cast<double>(tree[left].end - tree[left].begin) / (tree[part].end - tree[part].begin);
      const Ints side = partition::halve(quotient, share);
      for (std::size_t m = 0; m < members.size(); ++m) place[members[m]] = side[m] == 0 ? left : tree[part].right;
      open.push_back(tree[part].right);
      open.push_back(left);
    }
    for (const std::int32_t c : members) number[c] = -1;
  }
  return place;
}

/// Part of each own node and ghost before pieces are gathered.
std::vector<Label> label_nodes(const Communicator& comm, const NodeLinks& nodes, const IndexPartition& owners, const SeparatorTree& tree,
                               std::int32_t largest) {
  Ints cluster = comm.agree([&] {
    const auto share = static_cast<std::int32_t>(std::int64_t{kClusters} * nodes.own_nodes / owners.total());
    return partition::make_clusters(make_own_graph(nodes), std::min(std::max(share, kFewestClusters), std::max(nodes.own_nodes / 4, 1)));
  });
  const IndexPartition clusters(comm, cluster.empty() ? 0 : *std::max_element(cluster.begin(), cluster.end()) + std::int64_t{1});
  for (std::int32_t& c : cluster) c += static_cast<std::int32_t>(clusters.own_begin());
  const Ints ghost_cluster = fetch_ghosts(comm, nodes, owners, cluster);
  const Ints weights = comm::gather(comm, [&] {
    Ints own(clusters.own_count(), 0);
    for (const std::int32_t c : cluster) ++own[clusters.to_local(c)];
    return own;
  });
  const std::vector<Link> links = comm::gather(comm, [&] {
    std::vector<Link> own;
    for (std::int32_t v = 0; v < nodes.own_nodes; ++v)
      for (const std::int32_t* u = nodes.links.begin(v); u != nodes.links.end(v); ++u) {
        const std::int32_t to = *u < nodes.own_nodes ? cluster[*u] : ghost_cluster[*u - nodes.own_nodes];
        if (to != cluster[v]) own.push_back({cluster[v], to});
      }
    return own;
  });
  const Ints place = comm.broadcast([&] { return bisect_clusters(tree, weights, links, largest); });
  std::vector<Label> label(nodes.count());
  for (std::size_t v = 0; v < label.size(); ++v) label[v].part = place[v < cluster.size() ? cluster[v] : ghost_cluster[v - cluster.size()]];
  for (int depth = 0; depth < tree.depth(); ++depth) {
    std::vector<Ints> cut(comm.size());
    const auto edges = comm::all_to_all(comm, [&] {
      for (std::int32_t v = 0; v < nodes.own_nodes; ++v) {
        const Label mine = label[v];
        for (const std::int32_t* u = nodes.links.begin(v); mine.is_separator == 0 && u != nodes.links.end(v); ++u) {
          const Label other = label[*u];
          if (other.is_separator != 0 || other.part == mine.part) continue;
          const int common = tree.find_common(mine.part, other.part);
          if (tree[common].depth != depth || !tree.is_left_of(mine.part, common)) continue;
          Ints& list = cut[tree[common].begin];
          list.insert(list.end(), {nodes.find_global(v), nodes.find_global(*u), common});
        }
      }
      return join(cut);
    });
    const auto covers = comm::all_to_all(
        comm,
        [&] {
          std::vector<Link> covered;  // node, part
          std::vector<std::pair<std::int32_t, std::int32_t>> pairs;
          for (std::size_t k = 0; k < edges.items.size(); k += 3) pairs.emplace_back(edges.items[k], edges.items[k + 1]);
          if (!pairs.empty())
            for (const std::int32_t node : partition::cover_edges(pairs)) covered.push_back({node, edges.items[2]});
          return covered;
        },
        [&](const Link& one) { return owners.find_owner(one.from); });
    for (const Link& one : covers.items) label[owners.to_local(one.from)] = {one.to, 1};
    const std::vector<Label> ghosts = fetch_ghosts(comm, nodes, owners, label);
    std::copy(ghosts.begin(), ghosts.end(), label.begin() + nodes.own_nodes);
  }
  return label;
}

/// Nodes to be cut or ordered next, on the rank that holds the part.
struct Piece {
  Label label;
  Ints nodes;  // global numbers
  Graph graph;
};

/// Subset of the vertices of a piece. number: scratch of partition::take_part.
Piece take(const Piece& piece, const Ints& vertices, Label label, Ints& number) {
  Piece taken;
  taken.label = label;
  for (const std::int32_t v : vertices) taken.nodes.push_back(piece.nodes[v]);
  taken.graph = partition::take_part(piece.graph, vertices, number);
  return taken;
}

/// Cuts a piece into left part, right part and separator.
std::array<Piece, 3> cut(const Piece& piece, const Ints& side, const SeparatorTree& tree, const IndexPartition& owners) {
  const int part = piece.label.part;
  const int middle = tree[tree[part].right].begin;
  std::int64_t kept =
      0;  // nodes with rows on their target side minus other nodes; if all rows are on one rank, either orientation is as good
  for (std::size_t v = 0; v < side.size(); ++v)
    if (side[v] < 2) kept += (owners.find_owner(piece.nodes[v]) >= middle) == (side[v] == 1) ? 1 : -1;
  std::array<Ints, 3> sides;
  for (std::size_t v = 0; v < side.size(); ++v)
    sides[side[v] < 2 && kept < 0 ? 1 - side[v] : side[v]].push_back(static_cast<std::int32_t>(v));
  Ints number(piece.nodes.size(), -1);
  return {take(piece, sides[0], {tree[part].left, 0}, number), take(piece, sides[1], {tree[part].right, 0}, number),
          take(piece, sides[2], {part, 1}, number)};
}

void pack(const Piece& piece, Ints& list) {
  list.insert(list.end(), {piece.label.part, static_cast<std::int32_t>(piece.nodes.size())});
  list.insert(list.end(), piece.nodes.begin(), piece.nodes.end());
  for (std::size_t v = 0; v < piece.nodes.size(); ++v) list.push_back(piece.graph.offsets[v + 1] - piece.graph.offsets[v]);
  list.insert(list.end(), piece.graph.neighbours.begin(), piece.graph.neighbours.end());
}

Piece unpack(ListReader& reader) {
  Piece piece;
  piece.label.part = reader.next();
  piece.nodes = reader.take(reader.next());
  piece.graph.offsets.push_back(0);
  for (std::size_t v = 0; v < piece.nodes.size(); ++v) piece.graph.offsets.push_back(piece.graph.offsets.back() + reader.next());
  piece.graph.neighbours = reader.take(piece.graph.offsets.back());
  return piece;
}

/// Gathers the initial pieces of this rank, one per label. Collective.
std::vector<Piece> gather_pieces(const Communicator& comm, const NodeLinks& nodes, const SeparatorTree& tree,
                                 const std::vector<Label>& label) {
  const auto received = comm::all_to_all(comm, [&] {
    std::vector<Ints> lists(comm.size());
    for (std::int32_t v = 0; v < nodes.own_nodes; ++v) {
      const Label mine = label[v];
      Ints& list = lists[tree[mine.part].begin];
      list.insert(list.end(), {mine.part, mine.is_separator, nodes.find_global(v), 0});
      const std::size_t degree = list.size() - 1;
      for (const std::int32_t* u = nodes.links.begin(v); u != nodes.links.end(v); ++u)
        if (label[*u] == mine) list.push_back(nodes.find_global(*u));
      list[degree] = static_cast<std::int32_t>(list.size() - degree) - 1;
    }
    return join(lists);
  });
  return comm.agree([&] {
    std::vector<Piece> pieces;
    for (int part = 0; part <= tree.root(); ++part) {
      if (tree[part].begin != comm.rank()) continue;
      for (const std::int32_t is_separator : {0, 1}) {
        Piece piece;
        piece.label = {part, is_separator};
        piece.graph.offsets.push_back(0);
        for (ListReader reader(received.items); !reader.is_at_end();) {
          const Label here{reader.next(), reader.next()};
          const std::int32_t node = reader.next();
          const std::int32_t degree = reader.next();
          if (!(here == piece.label)) {
            reader.skip(degree);
            continue;
          }
          piece.nodes.push_back(node);
          for (std::int32_t k = 0; k < degree; ++k) piece.graph.neighbours.push_back(reader.next());
          piece.graph.offsets.push_back(static_cast<std::int32_t>(piece.graph.neighbours.size()));
        }
        if (piece.nodes.empty()) continue;
        // Nodes arrive in ascending order, often without gaps.
        const bool has_gaps = piece.nodes.back() - piece.nodes.front() >= static_cast<std::int32_t>(piece.nodes.size());
        for (std::int32_t& to : piece.graph.neighbours)
          to = has_gaps ? static_cast<std::int32_t>(std::lower_bound(piece.nodes.begin(), piece.nodes.end(), to) - piece.nodes.begin())
                        : to - piece.nodes.front();
        pieces.push_back(std::move(piece));
      }
    }
    return pieces;
  });
}

/// The piece of all nodes, which are all on this rank.
Piece make_whole(const NodeLinks& nodes, const SeparatorTree& tree) {
  Piece whole;
  whole.label = {tree.root(), 0};
  whole.nodes.resize(nodes.own_nodes);
  std::iota(whole.nodes.begin(), whole.nodes.end(), 0);
  whole.graph = {nodes.links.offsets, nodes.links.items};
  return whole;
}

/// Initial pieces of this rank. Collective.
std::vector<Piece> find_pieces(const Communicator& comm, const NodeLinks& nodes, const IndexPartition& owners, const SeparatorTree& tree,
                               std::int32_t largest) {
  const bool is_one_piece = owners.total() <= largest || comm.size() == 1;
  if (is_one_piece && owners.begin(1) == owners.total()) {
    return comm.agree([&] { return nodes.own_nodes > 0 ? std::vector<Piece>{make_whole(nodes, tree)} : std::vector<Piece>(); });
  }
  if (!is_one_piece) return gather_pieces(comm, nodes, tree, label_nodes(comm, nodes, owners, tree, largest));
  return gather_pieces(comm, nodes, tree, comm.agree([&] { return std::vector<Label>(nodes.count(), Label{tree.root(), 0}); }));
}

/// Appends the nodes of a piece to their part, ordered by METIS.
void place(const Piece& piece, std::optional<double> dominated_per_edge, std::vector<Ints>& placed) {
  Ints& list = placed[piece.label.part];
  const std::size_t before = list.size();
  list.resize(before + piece.nodes.size());
  const Ints order = partition::order_nested_dissection(piece.graph, dominated_per_edge);
  for (std::size_t v = 0; v < order.size(); ++v) list[before + static_cast<std::size_t>(order[v])] = piece.nodes[v];
}

/// True if a piece is cut at this depth of the tree.
bool is_cut(const Piece& piece, const SeparatorTree& tree, int depth) {
  return piece.label.is_separator == 0 && tree[piece.label.part].depth == depth && !tree[piece.label.part].is_leaf();
}

/// Sides of the piece that this rank cuts at this depth; empty if none. Collective: the ranks of its group compute separators too.
Ints seek_separator(const Communicator& comm, const std::vector<Piece>& pieces, const SeparatorTree& tree, int depth,
                    std::optional<double> dominated_per_edge) {
  const Piece* own = nullptr;
  for (const Piece& piece : pieces)
    if (is_cut(piece, tree, depth)) own = &piece;
  const auto copies = comm::all_to_all(comm, [&] {
    std::vector<Ints> lists(comm.size());
    if (own != nullptr && own->nodes.size() >= kSmallestCut) {
      const TreePart& part = tree[own->label.part];
      for (int rank = part.begin + 1; rank < std::min(part.end, part.begin + kTries); ++rank) pack(*own, lists[rank]);
    }
    return join(lists);
  });
  Ints best;
  const auto found = comm::all_to_all(comm, [&] {
    std::vector<Ints> lists(comm.size());
    if (own != nullptr)
      best = own->nodes.size() < kSmallestCut ? Ints(own->nodes.size(), 0) : partition::separate(own->graph, 1, 0, dominated_per_edge);
    for (ListReader reader(copies.items); !reader.is_at_end();) {
      const Piece piece = unpack(reader);
      const int holder = tree[piece.label.part].begin;
      lists[holder] = partition::separate(piece.graph, 1, comm.rank() - holder, dominated_per_edge);
    }
    return join(lists);
  });
  const auto count = [](const Ints& side) { return std::count(side.begin(), side.end(), 2); };
  comm.agree([&] {
    for (int rank = 0; rank < comm.size(); ++rank) {
      const Ints side(found.of(rank).begin(), found.of(rank).end());
      if (!side.empty() && count(side) < count(best)) best = side;
    }
  });
  return best;
}

}  // namespace

SeparatorTree::SeparatorTree(int ranks) { add(0, ranks, 0); }

int SeparatorTree::add(int begin, int end, int depth) {
  const int middle = begin + (end - begin) / 2;
  const int left = end - begin > 1 ? add(begin, middle, depth + 1) : -1;
  const int right = end - begin > 1 ? add(middle, end, depth + 1) : -1;
  const auto part = static_cast<int>(parts.size());
  for (const int child : {left, right})
    if (child >= 0) parts[child].parent = part;
  parts.push_back({begin, end, -1, left, right, depth, 0, 0, 0});
  depth_ = std::max(depth_, depth);
  return part;
}

int SeparatorTree::find_common(int a, int b) const {
  while (a != b) {
    int& lower = (*this)[a].depth >= (*this)[b].depth ? a : b;
    lower = (*this)[lower].parent;
  }
  return a;
}

int SeparatorTree::find_part(std::int32_t position) const {
  // Among parts with the same first position, all but the last are empty.
  const auto at =
      std::upper_bound(parts.begin(), parts.end(), position, [](std::int32_t p, const TreePart& part) { return p < part.first; });
  return static_cast<int>(at - parts.begin()) - 1;
}

std::vector<Ints> order_parts(const Communicator& comm, const NodeLinks& nodes, const IndexPartition& owners, SeparatorTree& tree,
                              std::int32_t largest, std::optional<double> dominated_per_edge) {
  std::vector<Piece> pieces = find_pieces(comm, nodes, owners, tree, largest);
  std::vector<Ints> placed(tree.parts.size());
  for (int depth = 0; depth < tree.depth(); ++depth) {
    const Ints side = seek_separator(comm, pieces, tree, depth, dominated_per_edge);
    const auto received = comm::all_to_all(comm, [&] {
      std::vector<Ints> lists(comm.size());
      for (Piece& piece : pieces) {
        if (!is_cut(piece, tree, depth)) continue;
        std::array<Piece, 3> sides = cut(piece, side, tree, owners);
        place(sides[2], dominated_per_edge, placed);
        pack(sides[1], lists[tree[sides[1].label.part].begin]);
        piece = std::move(sides[0]);
      }
      return join(lists);
    });
    comm.agree([&] {
      for (ListReader reader(received.items); !reader.is_at_end();) pieces.push_back(unpack(reader));
    });
  }
  comm.agree([&] {
    for (const Piece& piece : pieces) place(piece, dominated_per_edge, placed);
  });
  Ints counts;
  for (const Ints& list : placed) counts.push_back(static_cast<std::int32_t>(list.size()));
  comm.sum(std::span<std::int32_t>(counts));
  std::int32_t first = 0;
  for (std::size_t t = 0; t < tree.parts.size(); ++t) {
    tree.parts[t].first = first;
    tree.parts[t].count = counts[t];
    first += counts[t];
  }
  return placed;
}

}  // namespace carillon::ldlt
