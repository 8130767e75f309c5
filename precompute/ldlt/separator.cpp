// Method:     The separator between two ranks is a minimum vertex cover of the edges between them, found from a maximum matching; edges
//             that the pairs of ranks before have covered are left out. (The nodes of one side alone, a simpler cover, are up to twice as
//             many.) So subdomain nodes of different ranks are never neighbours, and each rank eliminates its own without a message.
//             Separator nodes that touch the same ranks form a group; eliminating a subdomain makes a clique of its boundary, so groups are
//             ordered by approximate minimum degree, weighted by their nodes, in a graph where those near a common rank are a clique. Wide
//             supernodes of the separator are cut into chains, and each link goes to that of the ranks below it in the tree which keeps the
//             fewest entries.
// Source:     Koenig 1931 (cover from matching); Pothen, Simon, Liou 1990 (partition/vertex_cover.cpp). Duff and Reid 1983, The
//             multifrontal solution of indefinite sparse symmetric linear equations. Geist and Ng 1989, Task scheduling for parallel sparse
//             Cholesky factorization (subtree to rank). Amestoy, Davis, Duff 1996, An approximate minimum degree ordering algorithm.
// Deviations: the separator is planned on every rank, in memory that grows with the whole separator (not with the whole graph).
#include "precompute/ldlt/separator.hpp"

#include <algorithm>
#include <map>
#include <numeric>
#include <set>

#include "partition/vertex_cover.hpp"
#include "precompute/petsc/session.hpp"

namespace carillon::ldlt {
namespace {

using partition::Graph;

Ints gather_ints(MPI_Comm comm, const Ints& own, std::vector<int>& counts) {
  int size = 0;
  MPI_Comm_size(comm, &size);
  counts.assign(size, 0);
  const int mine = static_cast<int>(own.size());
  MPI_Allgather(&mine, 1, MPI_INT, counts.data(), 1, MPI_INT, comm);
  std::vector<int> offsets(size, 0);
  std::partial_sum(counts.begin(), counts.end() - 1, offsets.begin() + 1);
  Ints all;
  comm::Communicator(comm).agree([&] { all.resize(static_cast<std::size_t>(offsets.back()) + static_cast<std::size_t>(counts.back())); });
  MPI_Allgatherv(own.data(), mine, MPI_INT32_T, all.data(), counts.data(), offsets.data(), MPI_INT32_T, comm);
  return all;
}

/// Fills the separator's nodes from the edges between ranks.
void cover_all(const Ragged& all, const Ints& rank_starts, Separator& separator) {
  std::map<std::pair<int, int>, std::vector<std::pair<std::int32_t, std::int32_t>>> by_ranks;
  for (std::int32_t i = 0; i < all.count(); ++i)
    for (const std::int32_t* b = all.begin(i) + 1; b != all.end(i); ++b)
      by_ranks[{find_rank(rank_starts, *all.begin(i)), find_rank(rank_starts, *b)}].emplace_back(*all.begin(i), *b);
  std::set<std::int32_t> cover;
  for (auto& [ranks, pairs] : by_ranks) {
    std::erase_if(pairs, [&](const auto& edge) { return cover.contains(edge.first) || cover.contains(edge.second); });
    const Ints fewest = partition::cover_edges(pairs);
    cover.insert(fewest.begin(), fewest.end());
  }
  separator.nodes.assign(cover.begin(), cover.end());
  separator.first_of_rank.clear();
  for (const std::int32_t start : rank_starts)
    separator.first_of_rank.push_back(
        static_cast<std::int32_t>(std::lower_bound(separator.nodes.begin(), separator.nodes.end(), start) - separator.nodes.begin()));
}

/// Separator nodes near the same ranks.
struct Groups {
  Ints group_of;              // by index
  Ints weight;                // nodes
  std::vector<Ints> links;    // by group, except those near a common rank
  std::vector<Ints> cliques;  // groups near a rank
};

Groups make_groups(const Separator& separator) {
  Groups groups;
  std::map<Ints, std::int32_t> known;
  std::map<std::int32_t, Ints> near;  // groups by rank
  for (std::int32_t i = 0; i < separator.count(); ++i) {
    const Ints ranks(separator.adjacent_ranks.begin(i), separator.adjacent_ranks.end(i));
    const auto [at, is_new] = known.try_emplace(ranks, static_cast<std::int32_t>(known.size()));
    if (is_new) {
      groups.weight.push_back(0);
      for (const std::int32_t rank : ranks) near[rank].push_back(at->second);
    }
    ++groups.weight[at->second];
    groups.group_of.push_back(at->second);
  }
  for (auto& [rank, members] : near) groups.cliques.push_back(std::move(members));
  groups.links.resize(groups.weight.size());
  for (std::int32_t i = 0; i < separator.count(); ++i)
    for (const std::int32_t* j = separator.links.begin(i); j != separator.links.end(i); ++j) {
      const std::int32_t a = groups.group_of[i];
      const std::int32_t b = groups.group_of[*j];
      if (a == b) continue;
      groups.links[a].push_back(b);
      groups.links[b].push_back(a);
    }
  for (Ints& list : groups.links) {
    std::sort(list.begin(), list.end());
    list.erase(std::unique(list.begin(), list.end()), list.end());
  }
  return groups;
}

/// Approximate minimum degree on the quotient graph: who lies in a common clique are neighbours, and eliminating a group merges its cliques
/// into one.
class GroupOrder {
 public:
  explicit GroupOrder(const Groups& groups)
      : weight_(groups.weight), links_(groups.links), cliques_(groups.cliques), cliques_of_(weight_.size()), mark_(weight_.size(), -1) {
    for (std::size_t c = 0; c < cliques_.size(); ++c) {
      for (const std::int32_t g : cliques_[c]) cliques_of_[g].push_back(static_cast<std::int32_t>(c));
      clique_weight_.push_back(add_weights(cliques_[c]));
    }
    outside_.resize(cliques_.size());
    seen_.assign(cliques_.size(), -1);
    for (std::int32_t g = 0; g < static_cast<std::int32_t>(weight_.size()); ++g) {
      degree_.push_back(weight_[g] + add_weights(find_neighbours(g, g)));
      queue_.emplace(degree_[g], g);
    }
    mark_.assign(weight_.size(), -1);
  }

  Ints find() {
    Ints order;
    while (!queue_.empty()) {
      order.push_back(queue_.begin()->second);
      queue_.erase(queue_.begin());
      eliminate(order.back(), static_cast<std::int32_t>(order.size()));
    }
    return order;
  }

 private:
  std::int64_t add_weights(const Ints& groups) const {
    std::int64_t sum = 0;
    for (const std::int32_t g : groups) sum += weight_[g];
    return sum;
  }

  Ints find_neighbours(std::int32_t group, std::int32_t stamp) {
    Ints found;
    const auto add = [&](const Ints& list) {
      for (const std::int32_t g : list) {
        if (g == group || mark_[g] == stamp) continue;
        mark_[g] = stamp;
        found.push_back(g);
      }
    };
    add(links_[group]);
    for (const std::int32_t c : cliques_of_[group]) add(cliques_[c]);
    return found;
  }

  void eliminate(std::int32_t group, std::int32_t stamp) {
    Ints members = find_neighbours(group, stamp);
    const auto clique = static_cast<std::int32_t>(cliques_.size());
    for (const std::int32_t c : cliques_of_[group]) {
      cliques_[c].clear();
      clique_weight_[c] = 0;
    }
    const std::int64_t weight = add_weights(members);
    // What the other cliques have outside the new one.
    for (const std::int32_t g : members)
      for (const std::int32_t c : cliques_of_[g]) {
        if (seen_[c] != stamp) outside_[c] = clique_weight_[c];
        seen_[c] = stamp;
        outside_[c] -= weight_[g];
      }
    for (const std::int32_t g : members) {
      std::erase_if(cliques_of_[g], [&](std::int32_t c) { return outside_[c] <= 0; });
      std::erase_if(links_[g], [&](std::int32_t h) { return h == group || mark_[h] == stamp; });
      std::int64_t degree = weight + add_weights(links_[g]);
      for (const std::int32_t c : cliques_of_[g]) degree += outside_[c];
      cliques_of_[g].push_back(clique);
      queue_.erase({degree_[g], g});
      degree_[g] = degree;
      queue_.emplace(degree, g);
    }
    cliques_.push_back(std::move(members));
    clique_weight_.push_back(weight);
    outside_.push_back(0);
    seen_.push_back(-1);
  }

  const Ints& weight_;
  std::vector<Ints> links_;
  std::vector<Ints> cliques_;
  std::vector<Ints> cliques_of_;  // by group
  Ints mark_;                     // by group
  Ints seen_;                     // by clique
  std::vector<std::int64_t> clique_weight_;
  std::vector<std::int64_t> outside_;
  std::vector<std::int64_t> degree_;
  std::set<std::pair<std::int64_t, std::int32_t>> queue_;
};

/// The separator in elimination order behind its elements.
Graph make_graph(const Separator& separator) {
  const std::int32_t elements = separator.elements.count();
  std::vector<Ints> hubs_at(separator.nodes.size());
  Graph graph;
  graph.offsets.push_back(0);
  const auto close = [&] { graph.offsets.push_back(static_cast<std::int32_t>(graph.neighbours.size())); };
  for (std::int32_t h = 0; h < elements; ++h) {
    for (const std::int32_t* row = separator.elements.begin(h); row != separator.elements.end(h); ++row) {
      graph.neighbours.push_back(elements + *row);
      hubs_at[*row].push_back(h);
    }
    close();
  }
  for (std::int32_t p = 0; p < separator.count(); ++p) {
    graph.neighbours.insert(graph.neighbours.end(), hubs_at[p].begin(), hubs_at[p].end());
    const std::int32_t i = separator.index[p];
    for (const std::int32_t* j = separator.links.begin(i); j != separator.links.end(i); ++j)
      graph.neighbours.push_back(elements + separator.position[*j]);
    close();
  }
  return graph;
}

void set_positions(Separator& separator, const Ints& position) {
  separator.position = position;
  separator.index.resize(position.size());
  for (std::size_t i = 0; i < position.size(); ++i) separator.index[position[i]] = static_cast<std::int32_t>(i);
}

/// Cuts wide supernodes into chains: each link is a front of its own, which may lie on any rank.
void cut_supernodes(Separator& separator) {
  constexpr std::int32_t kLinkNodes = 256;
  Forest& forest = separator.forest;
  std::vector<Supernode> links;
  Ints link_of(separator.nodes.size());
  for (const Supernode& node : forest.supernodes) {
    const std::int32_t count = (node.width + kLinkNodes - 1) / kLinkNodes;
    for (std::int32_t k = 0; k < count; ++k) {
      Supernode& link = links.emplace_back();
      const std::int32_t begin = node.width * k / count;
      const std::int32_t end = node.width * (k + 1) / count;
      link.first = node.first + begin;
      link.width = end - begin;
      for (std::int32_t p = node.first + end; p < node.first + node.width; ++p) link.rows.push_back(p);
      link.rows.insert(link.rows.end(), node.rows.begin(), node.rows.end());
      for (std::int32_t p = link.first; p < link.first + link.width; ++p) link_of[p] = static_cast<std::int32_t>(links.size()) - 1;
    }
  }
  for (Supernode& link : links) link.parent = link.rows.empty() ? -1 : link_of[link.rows.front()];
  for (std::int32_t h = 0; h < separator.elements.count(); ++h)
    if (forest.element_parents[h] >= 0) forest.element_parents[h] = link_of[*separator.elements.begin(h)];
  forest.supernodes = std::move(links);
}

/// Each supernode to that of the ranks whose work lies below it which keeps the fewest entries.
void choose_owners(Separator& separator, std::vector<double> entries) {
  const std::vector<Supernode>& supernodes = separator.forest.supernodes;
  std::vector<std::set<std::int32_t>> below(supernodes.size());
  for (std::int32_t h = 0; h < separator.elements.count(); ++h)
    if (separator.forest.element_parents[h] >= 0) below[separator.forest.element_parents[h]].insert(separator.element_rank[h]);
  separator.owner.resize(supernodes.size());
  for (std::size_t s = 0; s < supernodes.size(); ++s) {
    const Supernode& node = supernodes[s];
    if (below[s].empty()) below[s].insert(find_rank(separator.first_of_rank, separator.index[node.first]));
    separator.owner[s] = *std::min_element(below[s].begin(), below[s].end(), [&](int a, int b) { return entries[a] < entries[b]; });
    entries[separator.owner[s]] += static_cast<double>(count_entries(node.width, node.size()));
    if (node.parent >= 0) below[node.parent].insert(below[s].begin(), below[s].end());
    below[s].clear();
  }
}

}  // namespace

int find_rank(const Ints& starts, std::int32_t item) {
  return static_cast<int>(std::upper_bound(starts.begin(), starts.end(), item) - starts.begin()) - 1;
}

Ragged gather_ragged(MPI_Comm comm, const Ragged& own, Ints& first_of_rank) {
  Ints lengths;
  for (std::int32_t i = 0; i < own.count(); ++i) lengths.push_back(own.offsets[i + 1] - own.offsets[i]);
  std::vector<int> counts;
  const Ints all_lengths = gather_ints(comm, lengths, counts);
  first_of_rank.assign(1, 0);
  for (const int count : counts) first_of_rank.push_back(first_of_rank.back() + count);
  Ragged all;
  for (const std::int32_t length : all_lengths) all.offsets.push_back(all.offsets.back() + length);
  all.items = gather_ints(comm, own.items, counts);
  return all;
}

void find_separator(MPI_Comm comm, const Ragged& edges, const Ints& rank_starts, Separator& separator) {
  Ints first_of_rank;
  const Ragged all = gather_ragged(comm, edges, first_of_rank);
  comm::Communicator(comm).agree([&] { cover_all(all, rank_starts, separator); });
}

std::int32_t Separator::find(std::int32_t global_node) const {
  const auto at = std::lower_bound(nodes.begin(), nodes.end(), global_node);
  return at != nodes.end() && *at == global_node ? static_cast<std::int32_t>(at - nodes.begin()) : -1;
}

void order_separator(Separator& separator) {
  const Groups groups = make_groups(separator);
  const Ints order = GroupOrder(groups).find();
  Ints rank_of_group(order.size());
  for (std::size_t k = 0; k < order.size(); ++k) rank_of_group[order[k]] = static_cast<std::int32_t>(k);
  separator.index.resize(separator.nodes.size());
  std::iota(separator.index.begin(), separator.index.end(), 0);
  std::stable_sort(separator.index.begin(), separator.index.end(),
                   [&](std::int32_t a, std::int32_t b) { return rank_of_group[groups.group_of[a]] < rank_of_group[groups.group_of[b]]; });
  separator.position.resize(separator.nodes.size());
  for (std::int32_t p = 0; p < separator.count(); ++p) separator.position[separator.index[p]] = p;
}

void plan_separator(Separator& separator, std::vector<double> entries) {
  separator.forest = find_supernodes(make_graph(separator), separator.elements.count(), separator.count());
  const Ints& moved = separator.forest.position;
  for (std::int32_t& row : separator.elements.items) row = moved[row];
  for (std::int32_t h = 0; h < separator.elements.count(); ++h)
    std::sort(separator.elements.items.begin() + separator.elements.offsets[h],
              separator.elements.items.begin() + separator.elements.offsets[h + 1]);
  Ints position = separator.position;
  for (std::int32_t& p : position) p = moved[p];
  set_positions(separator, position);
  cut_supernodes(separator);
  choose_owners(separator, std::move(entries));
}

Ints find_touched_positions(const Separator& separator, int rank) {
  Ints touched;
  for (std::int32_t i = separator.first_of_rank[rank]; i < separator.first_of_rank[rank + 1]; ++i) {
    touched.push_back(separator.position[i]);
    for (const std::int32_t* j = separator.links.begin(i); j != separator.links.end(i); ++j) touched.push_back(separator.position[*j]);
  }
  for (std::int32_t h = 0; h < separator.elements.count(); ++h)
    if (separator.element_rank[h] == rank) touched.insert(touched.end(), separator.elements.begin(h), separator.elements.end(h));
  for (std::size_t s = 0; s < separator.owner.size(); ++s) {
    if (separator.owner[s] != rank) continue;
    const Supernode& node = separator.forest.supernodes[s];
    for (std::int32_t k = 0; k < node.width; ++k) touched.push_back(node.first + k);
    touched.insert(touched.end(), node.rows.begin(), node.rows.end());
  }
  std::sort(touched.begin(), touched.end());
  touched.erase(std::unique(touched.begin(), touched.end()), touched.end());
  return touched;
}

}  // namespace carillon::ldlt
