// Method:     Every node begins in one piece. While it is larger than one rank can gather, it is cut by its quotient graph: each rank makes
//             clusters of its own nodes, rank 0 bisects their graph down the tree, and part by part the edges between two sides are covered
//             by the fewest nodes. Then each piece is gathered and cut by vertex separators, the right half going to another rank, until
//             each rank has a leaf; up to four of the ranks below seek a separator each, and the smallest is taken; leaves and separators
//             are ordered by METIS. Of two halves that one goes left whose rows lie more on the ranks there. Fronts are found from the
//             leaves up: a leaf or a subtree hands on the rows of its roots as elements of the quotient graph, so no rank sees more than
//             the parts that it holds.
// Source:     George 1973, Nested dissection of a regular finite element mesh; Karypis and Kumar 1998 (METIS). Koenig 1931 (vertex cover).
//             Duff and Reid 1983 (elements of the quotient graph).
// Deviations: the quotient graph is bisected on one rank.
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

constexpr std::int32_t kClusters = 1024;      // of all ranks together
constexpr std::int32_t kFewestClusters = 64;  // of a rank
constexpr std::size_t kSmallestCut = 8;       // nodes: fewer stay together
constexpr int kTries = 4;                     // ranks that seek a separator of the same piece

int add_part(SeparatorTree& tree, int begin, int end, int depth) {
  int children[2] = {-1, -1};
  if (end - begin > 1) {
    const int middle = begin + (end - begin) / 2;
    children[0] = add_part(tree, begin, middle, depth + 1);
    children[1] = add_part(tree, middle, end, depth + 1);
  }
  const auto part = static_cast<int>(tree.parts.size());
  for (const int child : children)
    if (child >= 0) tree.parts[static_cast<std::size_t>(child)].parent = part;
  TreePart& added = tree.parts.emplace_back();
  added.begin = begin;
  added.end = end;
  added.depth = depth;
  return part;
}

/// The ways down the tree.
class Branches {
 public:
  explicit Branches(const SeparatorTree& tree) : tree_(tree), left_(tree.parts.size(), -1), right_(left_) {
    for (std::size_t t = 0; t < tree.parts.size(); ++t) {
      const TreePart& part = tree.parts[t];
      depth_ = std::max(depth_, part.depth);
      if (part.parent < 0) continue;
      const bool is_left = part.begin == tree.parts[static_cast<std::size_t>(part.parent)].begin;
      (is_left ? left_ : right_)[static_cast<std::size_t>(part.parent)] = static_cast<int>(t);
    }
  }
  int root() const { return static_cast<int>(tree_.parts.size()) - 1; }
  int left(int part) const { return left_[static_cast<std::size_t>(part)]; }
  int right(int part) const { return right_[static_cast<std::size_t>(part)]; }
  int depth() const { return depth_; }
  const TreePart& operator[](int part) const { return tree_.parts[static_cast<std::size_t>(part)]; }
  bool is_left_of(int part, int above) const { return (*this)[part].end <= (*this)[right(above)].begin; }
  int find_common(int a, int b) const {
    while (a != b) {
      int& lower = (*this)[a].depth >= (*this)[b].depth ? a : b;
      lower = (*this)[lower].parent;
    }
    return a;
  }

 private:
  const SeparatorTree& tree_;
  std::vector<int> left_, right_;
  int depth_ = 0;
};

/// The part where a node is, or of whose separator it is.
struct Label {
  std::int32_t part = 0;
  std::int32_t is_separator = 0;
  friend bool operator==(const Label&, const Label&) = default;
};

/// Values of ghosts, from their owners.
template <comm::Plain T>
std::vector<T> fetch_ghosts(const Communicator& comm, const NodeLinks& nodes, const IndexPartition& owners, const std::vector<T>& own) {
  return comm::query_owners<T>(
      comm, nodes.ghosts, [&](std::int32_t node) { return owners.find_owner(node); },
      [&](std::int32_t node) { return own[owners.to_local(node)]; });
}

/// The links among the own nodes.
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
  std::int32_t from = 0;
  std::int32_t to = 0;
  auto operator<=>(const Link&) const = default;
};

/// The part where each cluster stays: pieces of at most `largest` nodes, or leaves. Links are between clusters, each as often as there are
/// links between their nodes.
Ints bisect_clusters(const Branches& branches, const Ints& weights, std::vector<Link> links, std::int32_t largest) {
  std::sort(links.begin(), links.end());
  Ints place(weights.size(), branches.root());
  Ints number(weights.size(), -1);
  std::vector<int> open{branches.root()};
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
    if (nodes > largest && !branches[part].is_leaf() && members.size() > 1) {
      partition::WeightedGraph quotient;
      for (const std::int32_t c : members) {
        quotient.weights.push_back(weights[static_cast<std::size_t>(c)]);
        auto at = std::lower_bound(links.begin(), links.end(), Link{c, 0});
        for (; at != links.end() && at->from == c; ++at) {
          const std::int32_t to = number[static_cast<std::size_t>(at->to)];
          if (to < 0 || to == number[static_cast<std::size_t>(c)]) continue;
          if (static_cast<std::int32_t>(quotient.graph.neighbours.size()) == quotient.graph.offsets.back() ||
              quotient.graph.neighbours.back() != to) {
            quotient.graph.neighbours.push_back(to);
            quotient.links.push_back(0);
          }
          ++quotient.links.back();
        }
        quotient.graph.offsets.push_back(static_cast<std::int32_t>(quotient.graph.neighbours.size()));
      }
      const int left = branches.left(part);
      const double share = static_cast<double>(branches[left].end - branches[left].begin) / (branches[part].end - branches[part].begin);
      const Ints side = partition::halve(quotient, share);
      for (std::size_t m = 0; m < members.size(); ++m)
        place[static_cast<std::size_t>(members[m])] = side[m] == 0 ? left : branches.right(part);
      open.push_back(branches.right(part));
      open.push_back(left);
    }
    for (const std::int32_t c : members) number[static_cast<std::size_t>(c)] = -1;
  }
  return place;
}

/// Where each own node and ghost is before anything is gathered.
std::vector<Label> label_nodes(const Communicator& comm, const NodeLinks& nodes, const IndexPartition& owners, const Branches& branches,
                               std::int32_t largest) {
  std::vector<Label> label;
  if (owners.total() <= largest || comm.size() == 1)
    return comm.agree([&] { return std::vector<Label>(static_cast<std::size_t>(nodes.count()), Label{branches.root(), 0}); });
  Ints cluster = comm.agree([&] {
    const auto share = static_cast<std::int32_t>(std::int64_t{kClusters} * nodes.own_nodes / owners.total());
    return partition::make_clusters(make_own_graph(nodes), std::min(std::max(share, kFewestClusters), std::max(nodes.own_nodes / 4, 1)));
  });
  const IndexPartition clusters(comm, cluster.empty() ? 0 : *std::max_element(cluster.begin(), cluster.end()) + std::int64_t{1});
  for (std::int32_t& c : cluster) c += static_cast<std::int32_t>(clusters.own_begin());
  const Ints ghost_cluster = fetch_ghosts(comm, nodes, owners, cluster);
  const Ints weights = comm::gather(comm, [&] {
    Ints own(static_cast<std::size_t>(clusters.own_count()), 0);
    for (const std::int32_t c : cluster) ++own[clusters.to_local(c)];
    return own;
  });
  const std::vector<Link> links = comm::gather(comm, [&] {
    std::vector<Link> own;
    for (std::int32_t v = 0; v < nodes.own_nodes; ++v)
      for (const std::int32_t* u = nodes.links.begin(v); u != nodes.links.end(v); ++u) {
        const std::int32_t to =
            *u < nodes.own_nodes ? cluster[static_cast<std::size_t>(*u)] : ghost_cluster[static_cast<std::size_t>(*u - nodes.own_nodes)];
        if (to != cluster[static_cast<std::size_t>(v)]) own.push_back({cluster[static_cast<std::size_t>(v)], to});
      }
    return own;
  });
  const Ints place = comm.broadcast([&] { return bisect_clusters(branches, weights, links, largest); });
  label.assign(static_cast<std::size_t>(nodes.count()), {});
  for (std::size_t v = 0; v < label.size(); ++v)
    label[v].part = place[static_cast<std::size_t>(v < cluster.size() ? cluster[v] : ghost_cluster[v - cluster.size()])];
  for (int depth = 0; depth < branches.depth(); ++depth) {
    std::vector<Ints> cut(static_cast<std::size_t>(comm.size()));
    const auto edges = comm::all_to_all(comm, [&] {
      for (std::int32_t v = 0; v < nodes.own_nodes; ++v) {
        const Label mine = label[static_cast<std::size_t>(v)];
        for (const std::int32_t* u = nodes.links.begin(v); mine.is_separator == 0 && u != nodes.links.end(v); ++u) {
          const Label other = label[static_cast<std::size_t>(*u)];
          if (other.is_separator != 0 || other.part == mine.part) continue;
          const int common = branches.find_common(mine.part, other.part);
          if (branches[common].depth != depth || !branches.is_left_of(mine.part, common)) continue;
          Ints& list = cut[static_cast<std::size_t>(branches[common].begin)];
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

/// Nodes that are cut or ordered next, on the rank that holds the part.
struct Piece {
  Label label;
  Ints nodes;  // global
  Graph graph;
};

/// The graph of some of a piece's vertices alone. number: (vertices) scratch, -1.
Piece take(const Piece& piece, const Ints& vertices, Label label, Ints& number) {
  Piece taken;
  taken.label = label;
  taken.graph.offsets.push_back(0);
  for (std::size_t i = 0; i < vertices.size(); ++i) number[static_cast<std::size_t>(vertices[i])] = static_cast<std::int32_t>(i);
  for (const std::int32_t v : vertices) {
    taken.nodes.push_back(piece.nodes[static_cast<std::size_t>(v)]);
    for (std::int32_t k = piece.graph.offsets[static_cast<std::size_t>(v)]; k < piece.graph.offsets[static_cast<std::size_t>(v) + 1]; ++k) {
      const std::int32_t to = number[static_cast<std::size_t>(piece.graph.neighbours[static_cast<std::size_t>(k)])];
      if (to >= 0) taken.graph.neighbours.push_back(to);
    }
    taken.graph.offsets.push_back(static_cast<std::int32_t>(taken.graph.neighbours.size()));
  }
  for (const std::int32_t v : vertices) number[static_cast<std::size_t>(v)] = -1;
  return taken;
}

/// Into what is left of the separator, right of it, and the separator.
std::array<Piece, 3> cut(const Piece& piece, const Ints& side, const Branches& branches, const IndexPartition& owners) {
  const int part = piece.label.part;
  const int middle = branches[branches.right(part)].begin;
  std::int64_t kept = 0;  // nodes whose rows are where their side would go, less those whose are not
  for (std::size_t v = 0; v < side.size(); ++v)
    if (side[v] < 2) kept += (owners.find_owner(piece.nodes[v]) >= middle) == (side[v] == 1) ? 1 : -1;
  std::array<Ints, 3> sides;
  for (std::size_t v = 0; v < side.size(); ++v)
    sides[static_cast<std::size_t>(side[v] < 2 && kept < 0 ? 1 - side[v] : side[v])].push_back(static_cast<std::int32_t>(v));
  Ints number(piece.nodes.size(), -1);
  return {take(piece, sides[0], {branches.left(part), 0}, number), take(piece, sides[1], {branches.right(part), 0}, number),
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

/// The pieces that this rank begins with.
std::vector<Piece> gather_pieces(const Communicator& comm, const NodeLinks& nodes, const Branches& branches,
                                 const std::vector<Label>& label) {
  const auto received = comm::all_to_all(comm, [&] {
    std::vector<Ints> lists(static_cast<std::size_t>(comm.size()));
    for (std::int32_t v = 0; v < nodes.own_nodes; ++v) {
      const Label mine = label[static_cast<std::size_t>(v)];
      Ints& list = lists[static_cast<std::size_t>(branches[mine.part].begin)];
      list.insert(list.end(), {mine.part, mine.is_separator, nodes.find_global(v), 0});
      const std::size_t degree = list.size() - 1;
      for (const std::int32_t* u = nodes.links.begin(v); u != nodes.links.end(v); ++u)
        if (label[static_cast<std::size_t>(*u)] == mine) list.push_back(nodes.find_global(*u));
      list[degree] = static_cast<std::int32_t>(list.size() - degree) - 1;
    }
    return join(lists);
  });
  return comm.agree([&] {
    std::vector<Piece> pieces;
    for (int part = 0; part <= branches.root(); ++part) {
      if (branches[part].begin != comm.rank()) continue;
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
        for (std::int32_t& to : piece.graph.neighbours)  // nodes came in ascending order
          to = static_cast<std::int32_t>(std::lower_bound(piece.nodes.begin(), piece.nodes.end(), to) - piece.nodes.begin());
        pieces.push_back(std::move(piece));
      }
    }
    return pieces;
  });
}

/// Appends the piece's nodes to their part, in the order of METIS.
void place(const Piece& piece, std::vector<Ints>& placed) {
  Ints& list = placed[static_cast<std::size_t>(piece.label.part)];
  const std::size_t before = list.size();
  list.resize(before + piece.nodes.size());
  const Ints order = partition::order_nested_dissection(piece.graph);
  for (std::size_t v = 0; v < order.size(); ++v) list[before + static_cast<std::size_t>(order[v])] = piece.nodes[v];
}

/// Whether a piece is cut at this depth of the tree.
bool is_cut(const Piece& piece, const Branches& branches, int depth) {
  return piece.label.is_separator == 0 && branches[piece.label.part].depth == depth && !branches[piece.label.part].is_leaf();
}

/// The sides of the piece that this rank cuts at this depth, empty: it cuts none. Collective: its group seeks separators with it.
Ints seek_separator(const Communicator& comm, const std::vector<Piece>& pieces, const Branches& branches, int depth) {
  const Piece* own = nullptr;
  for (const Piece& piece : pieces)
    if (is_cut(piece, branches, depth)) own = &piece;
  const auto copies = comm::all_to_all(comm, [&] {
    std::vector<Ints> lists(static_cast<std::size_t>(comm.size()));
    if (own != nullptr && own->nodes.size() >= kSmallestCut) {
      const TreePart& part = branches[own->label.part];
      for (int rank = part.begin + 1; rank < std::min(part.end, part.begin + kTries); ++rank)
        pack(*own, lists[static_cast<std::size_t>(rank)]);
    }
    return join(lists);
  });
  Ints best;
  const auto found = comm::all_to_all(comm, [&] {
    std::vector<Ints> lists(static_cast<std::size_t>(comm.size()));
    if (own != nullptr) best = own->nodes.size() < kSmallestCut ? Ints(own->nodes.size(), 0) : partition::separate(own->graph, 1);
    for (ListReader reader(copies.items); !reader.is_at_end();) {
      const Piece piece = unpack(reader);
      const int holder = branches[piece.label.part].begin;
      lists[static_cast<std::size_t>(holder)] = partition::separate(piece.graph, 1, comm.rank() - holder);
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

/// The nodes of each part that this rank holds, in the order of elimination. Fills first and count of the parts. Collective.
std::vector<Ints> order_parts(const Communicator& comm, const NodeLinks& nodes, const IndexPartition& owners, SeparatorTree& tree,
                              std::int32_t largest) {
  const Branches branches(tree);
  std::vector<Piece> pieces = gather_pieces(comm, nodes, branches, label_nodes(comm, nodes, owners, branches, largest));
  std::vector<Ints> placed(tree.parts.size());
  for (int depth = 0; depth < branches.depth(); ++depth) {
    const Ints side = seek_separator(comm, pieces, branches, depth);
    const auto received = comm::all_to_all(comm, [&] {
      std::vector<Ints> lists(static_cast<std::size_t>(comm.size()));
      for (Piece& piece : pieces) {
        if (!is_cut(piece, branches, depth)) continue;
        std::array<Piece, 3> sides = cut(piece, side, branches, owners);
        place(sides[2], placed);
        pack(sides[1], lists[static_cast<std::size_t>(branches[sides[1].label.part].begin)]);
        piece = std::move(sides[0]);
      }
      return join(lists);
    });
    comm.agree([&] {
      for (ListReader reader(received.items); !reader.is_at_end();) pieces.push_back(unpack(reader));
    });
  }
  comm.agree([&] {
    for (const Piece& piece : pieces) place(piece, placed);
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

/// What a subtree leaves behind: the rows of one of its roots, and which front that is.
struct Element {
  std::int32_t part = 0;
  std::int32_t supernode = 0;
  Ints rows;  // positions, ascending
};

/// Eliminates a part on paper. links: of each of its positions those behind, and of a leaf all. Elements that have no row in the part go
/// to `left` as they are, the roots of the part too; `parents` gets the front above each element.
class PartEliminator {
 public:
  PartEliminator(const TreePart& part, HeldPart& held, const Ragged& links, std::vector<Element>& elements)
      : part_(part), held_(held), links_(links), elements_(elements) {}

  /// above: (elements) the supernode above each, -1: none here.
  std::vector<Element> run(Ints& above) {
    find_boundary();
    const auto hubs = static_cast<std::int32_t>(elements_.size());
    held_.forest = find_supernodes(make_graph(), hubs, part_.count);
    above = held_.forest.element_parents;
    std::vector<Element> left;
    for (std::size_t h = 0; h < elements_.size(); ++h)
      if (above[h] < 0 && !elements_[h].rows.empty()) left.push_back(std::move(elements_[h]));
    Ints ordered(held_.nodes.size());
    for (std::size_t k = 0; k < ordered.size(); ++k) ordered[static_cast<std::size_t>(held_.forest.position[k])] = held_.nodes[k];
    held_.nodes = std::move(ordered);
    for (std::size_t s = 0; s < held_.forest.supernodes.size(); ++s) {
      Supernode& node = held_.forest.supernodes[s];
      node.first += part_.first;
      for (std::int32_t& row : node.rows)
        row = row < part_.count ? part_.first + row : boundary_[static_cast<std::size_t>(row - part_.count)];
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

  /// Elements, pivots, boundary.
  Graph make_graph() const {
    const auto hubs = static_cast<std::int32_t>(elements_.size());
    const std::int32_t behind = part_.first + part_.count;
    const auto find = [&](std::int32_t position) {
      if (position < behind) return hubs + position - part_.first;
      const auto at = std::lower_bound(boundary_.begin(), boundary_.end(), position) - boundary_.begin();
      return hubs + part_.count + static_cast<std::int32_t>(at);
    };
    std::vector<Ints> inward(static_cast<std::size_t>(part_.count) + boundary_.size());  // of pivots: elements; of the boundary: pivots too
    Graph graph;
    graph.offsets.push_back(0);
    const auto close = [&] { graph.offsets.push_back(static_cast<std::int32_t>(graph.neighbours.size())); };
    for (std::int32_t h = 0; h < hubs; ++h) {
      for (const std::int32_t row : elements_[static_cast<std::size_t>(h)].rows) {
        graph.neighbours.push_back(find(row));
        inward[static_cast<std::size_t>(find(row) - hubs)].push_back(h);
      }
      close();
    }
    for (std::int32_t p = 0; p < part_.count; ++p) {
      const Ints& near = inward[static_cast<std::size_t>(p)];
      graph.neighbours.insert(graph.neighbours.end(), near.begin(), near.end());
      for (const std::int32_t* to = links_.begin(p); to != links_.end(p); ++to) {
        if (*to < part_.first) continue;  // in a subtree below: an element stands for it
        graph.neighbours.push_back(find(*to));
        if (*to >= behind) inward[static_cast<std::size_t>(find(*to) - hubs)].push_back(hubs + p);
      }
      close();
    }
    for (std::size_t b = static_cast<std::size_t>(part_.count); b < inward.size(); ++b) {
      graph.neighbours.insert(graph.neighbours.end(), inward[b].begin(), inward[b].end());
      close();
    }
    return graph;
  }

  const TreePart& part_;
  HeldPart& held_;
  const Ragged& links_;
  std::vector<Element>& elements_;
  Ints boundary_;
};

/// Links of the nodes of each held part, by position. Collective.
std::vector<Ragged> send_links(const Communicator& comm, const NodeLinks& nodes, const Elimination& all) {
  const auto received = comm::all_to_all(comm, [&] {
    std::vector<Ints> lists(static_cast<std::size_t>(comm.size()));
    for (std::int32_t v = 0; v < nodes.own_nodes; ++v) {
      const std::int32_t position = all.position[static_cast<std::size_t>(v)];
      Ints& list = lists[static_cast<std::size_t>(all.tree.find_holder(position))];
      list.insert(list.end(),
                  {position, nodes.links.offsets[static_cast<std::size_t>(v) + 1] - nodes.links.offsets[static_cast<std::size_t>(v)]});
      for (const std::int32_t* u = nodes.links.begin(v); u != nodes.links.end(v); ++u)
        list.push_back(all.position[static_cast<std::size_t>(*u)]);
    }
    return join(lists);
  });
  return comm.agree([&] {
    std::vector<Ragged> links(all.parts.size());
    std::vector<std::vector<std::size_t>> at(all.parts.size());
    std::vector<std::size_t> held_of(all.tree.parts.size(), 0);
    for (std::size_t h = 0; h < all.parts.size(); ++h) {
      at[h].assign(static_cast<std::size_t>(all.tree.parts[static_cast<std::size_t>(all.parts[h].part)].count), 0);
      held_of[static_cast<std::size_t>(all.parts[h].part)] = h;
    }
    for (ListReader reader(received.items); !reader.is_at_end();) {
      const std::int32_t position = reader.next();
      const auto part = static_cast<std::size_t>(all.tree.find_part(position));
      at[held_of[part]][static_cast<std::size_t>(position - all.tree.parts[part].first)] = reader.place();
      reader.skip(reader.next());
    }
    for (std::size_t h = 0; h < links.size(); ++h)
      for (const std::size_t place : at[h]) {
        const std::int32_t* list = received.items.data() + place;
        links[h].items.insert(links[h].items.end(), list + 1, list + 1 + *list);
        links[h].close();
      }
    return links;
  });
}

/// The front above each root, as (part, supernode) of both.
struct Above {
  std::int32_t part, supernode, above_part, above_supernode;
};

std::vector<Above> eliminate_parts(const Communicator& comm, Elimination& all, const std::vector<Ragged>& links) {
  const Branches branches(all.tree);
  std::vector<Above> found;
  std::vector<Element> elements;  // for the part that comes next
  for (int depth = branches.depth(); depth >= 0; --depth) {
    const auto received = comm::all_to_all(comm, [&] {
      std::vector<Ints> lists(static_cast<std::size_t>(comm.size()));
      for (std::size_t h = 0; h < all.parts.size(); ++h) {
        HeldPart& held = all.parts[h];
        const TreePart& part = branches[held.part];
        if (part.depth != depth) continue;
        Ints above;
        std::vector<Element> arrived = std::exchange(elements, {});
        std::vector<Element> named;
        for (const Element& element : arrived) named.push_back({element.part, element.supernode, {}});
        const std::vector<Element> left = PartEliminator(part, held, links[h], arrived).run(above);
        for (std::size_t k = 0; k < named.size(); ++k)
          if (above[k] >= 0) found.push_back({named[k].part, named[k].supernode, held.part, above[k]});
        for (const Element& element : left) {
          Ints& list = lists[static_cast<std::size_t>(branches[part.parent].begin)];
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

/// Numbers the fronts, and reports to the holder of each root which front is above it. Collective.
void link_parts(const Communicator& comm, Elimination& all, const std::vector<Above>& found) {
  Ints counts(all.tree.parts.size(), 0);
  for (const HeldPart& held : all.parts)
    counts[static_cast<std::size_t>(held.part)] = static_cast<std::int32_t>(held.forest.supernodes.size());
  comm.sum(std::span<std::int32_t>(counts));
  all.tree.fronts = 0;
  for (std::size_t t = 0; t < counts.size(); ++t) {
    all.tree.parts[t].first_front = all.tree.fronts;
    all.tree.fronts += counts[t];
  }
  const auto first_front = [&](std::int32_t part) { return all.tree.parts[static_cast<std::size_t>(part)].first_front; };
  const auto reported =
      comm::all_to_all(comm, found, [&](const Above& one) { return all.tree.parts[static_cast<std::size_t>(one.part)].begin; });
  comm.agree([&] {
    for (HeldPart& held : all.parts) {
      held.parents.clear();
      for (const Supernode& node : held.forest.supernodes)
        held.parents.push_back(node.parent < 0 ? -1 : first_front(held.part) + node.parent);
      for (const Above& one : reported.items)
        if (one.part == held.part)
          held.parents[static_cast<std::size_t>(one.supernode)] = first_front(one.above_part) + one.above_supernode;
    }
  });
}

/// The last places of positions that the holders of their parts have moved. Collective.
Ints find_moved(const Communicator& comm, const Elimination& all, const Ints& positions) {
  std::vector<const HeldPart*> held_of(all.tree.parts.size(), nullptr);
  for (const HeldPart& held : all.parts) held_of[static_cast<std::size_t>(held.part)] = &held;
  return comm::query_owners<std::int32_t>(
      comm, positions, [&](std::int32_t position) { return all.tree.find_holder(position); },
      [&](std::int32_t position) {
        const auto part = static_cast<std::size_t>(all.tree.find_part(position));
        const std::int32_t first = all.tree.parts[part].first;
        return first + held_of[part]->forest.position[static_cast<std::size_t>(position - first)];
      });
}

}  // namespace

int SeparatorTree::find_part(std::int32_t position) const {
  // Of parts that begin at the same place all but the last are empty.
  const auto at =
      std::upper_bound(parts.begin(), parts.end(), position, [](std::int32_t p, const TreePart& part) { return p < part.first; });
  return static_cast<int>(at - parts.begin()) - 1;
}

Elimination eliminate_on_paper(const Communicator& comm, const NodeLinks& nodes, const IndexPartition& owners,
                               std::int32_t largest_gathered) {
  Elimination all;
  comm.agree([&] { add_part(all.tree, 0, comm.size(), 0); });
  std::vector<Ints> placed = order_parts(comm, nodes, owners, all.tree, largest_gathered);
  const auto reported = comm::all_to_all(
      comm,
      [&] {
        std::vector<Link> list;  // node, position
        for (std::size_t t = 0; t < placed.size(); ++t) {
          std::int32_t position = all.tree.parts[t].first;
          for (const std::int32_t node : placed[t]) list.push_back({node, position++});
          if (all.tree.parts[t].begin != comm.rank()) continue;
          HeldPart& held = all.parts.emplace_back();
          held.part = static_cast<int>(t);
          held.nodes = std::move(placed[t]);
        }
        return list;
      },
      [&](const Link& one) { return owners.find_owner(one.from); });
  comm.agree([&] {
    all.position.assign(static_cast<std::size_t>(nodes.own_nodes), -1);
    for (const Link& one : reported.items) all.position[owners.to_local(one.from)] = one.to;
  });
  const Ints ghosts = fetch_ghosts(comm, nodes, owners, all.position);
  all.position.insert(all.position.end(), ghosts.begin(), ghosts.end());
  link_parts(comm, all, eliminate_parts(comm, all, send_links(comm, nodes, all)));

  // Positions as they are after the fronts have been found.
  Ints asked = all.position;
  for (const HeldPart& held : all.parts) {
    const TreePart& part = all.tree.parts[static_cast<std::size_t>(held.part)];
    for (const Supernode& node : held.forest.supernodes)
      for (const std::int32_t row : node.rows)
        if (row >= part.first + part.count) asked.push_back(row);
  }
  const Ints known = find_moved(comm, all, asked);
  comm.agree([&] {
    std::copy_n(known.begin(), all.position.size(), all.position.begin());
    auto next = known.begin() + static_cast<std::ptrdiff_t>(all.position.size());
    for (HeldPart& held : all.parts) {
      const TreePart& part = all.tree.parts[static_cast<std::size_t>(held.part)];
      for (Supernode& node : held.forest.supernodes) {
        for (std::int32_t& row : node.rows)
          if (row >= part.first + part.count) row = *next++;
        std::sort(node.rows.begin(), node.rows.end());
      }
    }
  });
  return all;
}

}  // namespace carillon::ldlt
