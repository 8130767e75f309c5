// Method: elements travel to their parts. Every rank tells the home of each node that it touches it; the home gives the node to the highest
//   of them and answers with position and owner. Owners number their free nodes in ascending order and the homes pass the numbers on to the
//   halos. Components: each rank joins its own nodes; the homes join what meets in one node; the pairs, which are few, go to all ranks.
// Source: own.
// Deviations: none.
#include "precompute/slabs/settle.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <utility>

#include "precompute/mesh/faces.hpp"
#include "runtime/base/error.hpp"

namespace carillon::slabs {
namespace {

/// This rank's elements and the numbers of their nodes.
struct Piece {
  std::vector<std::int32_t> tets;    // (e, width) numbers of nodes
  std::vector<std::int32_t> number;  // (e)
  std::vector<std::int32_t> region;  // (e)
};

template <std::size_t width>
struct Element {
  std::int32_t number, region;
  std::array<std::int32_t, width> nodes;
};

template <std::size_t width>
Piece move_elements(MPI_Comm comm, Slab& slab, const std::vector<std::int32_t>& part) {
  std::vector<Element<width>> elements;
  petsc::run_agreed(comm, [&] {
    const auto first = static_cast<std::int32_t>(slab.elements.first[static_cast<std::size_t>(get_rank(comm))]);
    elements.resize(part.size());
    for (std::size_t e = 0; e < part.size(); ++e) {
      elements[e].number = first + static_cast<std::int32_t>(e);
      elements[e].region = slab.regions[e];
      std::copy_n(slab.tets.begin() + static_cast<std::ptrdiff_t>(e * width), width, elements[e].nodes.begin());
    }
    slab.tets = {};
    slab.regions = {};
    slab.centres_m = {};
  });
  const std::int64_t first = slab.elements.first[static_cast<std::size_t>(get_rank(comm))];
  auto arrived =
      route(comm, elements, [&](const Element<width>& element) { return part[static_cast<std::size_t>(element.number - first)]; });
  Piece piece;
  petsc::run_agreed(comm, [&] {
    elements = {};
    std::sort(arrived.items.begin(), arrived.items.end(), [](const auto& x, const auto& y) { return x.number < y.number; });
    piece.tets.reserve(width * arrived.items.size());
    for (const auto& element : arrived.items) {
      piece.tets.insert(piece.tets.end(), element.nodes.begin(), element.nodes.end());
      piece.number.push_back(element.number);
      piece.region.push_back(element.region);
    }
  });
  return piece;
}

struct Touch {
  std::int32_t node, group;  // group: number of the rank's own component, over all ranks
};

struct NodeAnswer {
  Vec3 x;
  std::int32_t owner;
  std::int32_t is_shared;
  std::int32_t held;  // Slab::held
};

/// Owners of the nodes at home here: the highest rank that touches them, as fem::distribute has it. `arrived`: who touches them.
std::vector<std::int32_t> find_owners(int rank, const Slab& slab, const Arrived<Touch>& arrived, std::vector<char>& is_shared) {
  std::vector<std::int32_t> owner(slab.nodes_m.size(), -1);
  is_shared.assign(slab.nodes_m.size(), 0);
  std::size_t i = 0;
  for (std::size_t source = 0; source < arrived.count.size(); ++source)
    for (int k = 0; k < arrived.count[source]; ++k, ++i) {
      const std::size_t place = slab.find_place(arrived.items[i].node, rank);
      if (owner[place] >= 0) is_shared[place] = 1;
      owner[place] = static_cast<std::int32_t>(source);  // sources ascend
    }
  return owner;
}

/// Component of each local group, numbered by their lowest nodes, the same on every rank. `links`: pairs of groups that meet. Collective.
std::vector<std::int32_t> find_components(MPI_Comm comm, const std::vector<std::int32_t>& lowest_node,
                                          std::vector<std::pair<std::int32_t, std::int32_t>> links, std::int32_t& count) {
  struct Link {
    std::int32_t a, b;
  };
  std::vector<Link> own;
  petsc::run_agreed(comm, [&] {
    std::sort(links.begin(), links.end());
    links.erase(std::unique(links.begin(), links.end()), links.end());
    for (const auto& [a, b] : links) own.push_back({a, b});
  });
  const auto all_links = share(comm, own);
  const auto lowest = share(comm, lowest_node);
  std::vector<std::int32_t> component;
  petsc::run_agreed(comm, [&] {
    mesh::Parts parts(lowest.size());
    for (const Link& link : all_links) parts.join(link.a, link.b);
    std::vector<std::int32_t> low(lowest.size(), INT32_MAX);
    for (std::size_t g = 0; g < lowest.size(); ++g) {
      auto& one = low[static_cast<std::size_t>(parts.find(static_cast<std::int32_t>(g)))];
      one = std::min(one, lowest[g]);
    }
    std::vector<std::pair<std::int32_t, std::int32_t>> roots;  // lowest node, group
    for (std::size_t g = 0; g < lowest.size(); ++g)
      if (parts.find(static_cast<std::int32_t>(g)) == static_cast<std::int32_t>(g))
        roots.emplace_back(low[g], static_cast<std::int32_t>(g));
    std::sort(roots.begin(), roots.end());
    std::vector<std::int32_t> of_root(lowest.size(), -1);
    for (std::size_t i = 0; i < roots.size(); ++i) of_root[static_cast<std::size_t>(roots[i].second)] = static_cast<std::int32_t>(i);
    component.resize(lowest.size());
    for (std::size_t g = 0; g < lowest.size(); ++g)
      component[g] = of_root[static_cast<std::size_t>(parts.find(static_cast<std::int32_t>(g)))];
    count = static_cast<std::int32_t>(roots.size());
  });
  return component;
}

/// Per component up to three held points that hold it as firmly as all do, the same on every rank. Collective.
std::vector<std::vector<Vec3>> share_holding_points(MPI_Comm comm, const fem::LocalMesh& local, std::int32_t components) {
  struct Point {
    Vec3 x;
    std::int32_t component;
  };
  std::vector<Point> own;
  petsc::run_agreed(comm, [&] {
    std::vector<std::pair<std::int32_t, std::int32_t>> held;  // component, local node
    for (std::int32_t i = local.free_nodes; i < local.owned_nodes; ++i) held.emplace_back(local.component[static_cast<std::size_t>(i)], i);
    std::sort(held.begin(), held.end());
    for (std::size_t i = 0; i < held.size();) {
      const std::int32_t component = held[i].first;
      std::vector<Vec3> points;
      for (; i < held.size() && held[i].first == component; ++i) points.push_back(local.nodes_m[static_cast<std::size_t>(held[i].second)]);
      for (const Vec3& x : fem::pick_holding_points(points)) own.push_back({x, component});
    }
  });
  const auto all = share(comm, own);
  std::vector<std::vector<Vec3>> points;
  petsc::run_agreed(comm, [&] {
    points.resize(static_cast<std::size_t>(components));
    for (const Point& point : all) points[static_cast<std::size_t>(point.component)].push_back(point.x);
    for (auto& list : points) list = fem::pick_holding_points(list);
  });
  return points;
}

/// Everything of a node that this rank touches.
struct LocalNode {
  std::int32_t number, owner, component;
  std::int32_t held;  // Slab::held
  bool is_shared;
  Vec3 x;
};

/// Puts the nodes in LocalMesh's order and counts; rows are filled for owned nodes only.
fem::LocalMesh make_local(int rank, int order, Piece& piece, std::vector<LocalNode>& nodes, std::vector<char>& is_shared) {
  fem::LocalMesh local;
  local.order = order;
  std::vector<std::int32_t> sorted(nodes.size());
  std::iota(sorted.begin(), sorted.end(), 0);
  const auto kind = [&](const LocalNode& node) { return node.owner != rank ? 2 : node.held != 0 ? 1 : 0; };
  std::sort(sorted.begin(), sorted.end(), [&](std::int32_t i, std::int32_t j) {
    const LocalNode &a = nodes[static_cast<std::size_t>(i)], &b = nodes[static_cast<std::size_t>(j)];
    return std::pair(kind(a), a.number) < std::pair(kind(b), b.number);
  });
  std::vector<std::int32_t> place(nodes.size());
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    const LocalNode& node = nodes[static_cast<std::size_t>(sorted[i])];
    place[static_cast<std::size_t>(sorted[i])] = static_cast<std::int32_t>(i);
    local.nodes_m.push_back(node.x);
    local.node_in_mesh.push_back(node.number);
    local.component.push_back(node.component);
    local.fixed_by.push_back(node.held - 1);
    is_shared.push_back(node.is_shared ? 1 : 0);
    local.free_nodes += kind(node) == 0;
    local.owned_nodes += kind(node) < 2;
  }
  local.row.assign(nodes.size(), -1);
  local.tets = std::move(piece.tets);
  for (std::int32_t& node : local.tets) node = place[static_cast<std::size_t>(node)];  // indices into `nodes` until here
  local.tet_in_mesh = std::move(piece.number);
  local.region = std::move(piece.region);
  return local;
}

/// Numbers the free nodes of all ranks and tells the halos. Collective.
void number_rows(MPI_Comm comm, const std::string& name, const Slab& slab, const std::vector<char>& is_shared, fem::Distribution& pieces) {
  fem::LocalMesh& local = pieces.local;
  const int rank = get_rank(comm);
  const Homes rows = gather_homes(comm, local.free_nodes);
  pieces.free_nodes = rows.total();
  petsc::run_agreed(comm, [&] {
    if (pieces.free_nodes == 0)
      throw InputError(fmt::format(
          "{}: 'fixed' holds every node of the mesh, so that nothing can move; hold fewer nodes (a smaller box or node set)", name));
    if (pieces.free_nodes > INT32_MAX / 3)
      throw InputError(
          fmt::format("{}: the mesh has {} free nodes, 32-bit matrix rows end at 715827882; use a coarser mesh", name, pieces.free_nodes));
  });
  local.first_row = static_cast<std::int32_t>(rows.first[static_cast<std::size_t>(rank)]);
  for (std::int32_t i = 0; i < local.free_nodes; ++i) local.row[static_cast<std::size_t>(i)] = local.first_row + i;
  struct Row {
    std::int32_t node, row;
  };
  std::vector<Row> told;
  std::vector<std::int32_t> halo;
  petsc::run_agreed(comm, [&] {
    for (std::int32_t i = 0; i < local.free_nodes; ++i)
      if (is_shared[static_cast<std::size_t>(i)] != 0)
        told.push_back({local.node_in_mesh[static_cast<std::size_t>(i)], local.row[static_cast<std::size_t>(i)]});
    halo.assign(local.node_in_mesh.begin() + local.owned_nodes, local.node_in_mesh.end());
  });
  const auto arrived = route(comm, told, [&](const Row& row) { return slab.find_home(row.node); });
  std::vector<std::int32_t> row_at_home;
  petsc::run_agreed(comm, [&] {
    row_at_home.assign(slab.nodes_m.size(), -1);
    for (const Row& row : arrived.items) row_at_home[slab.find_place(row.node, rank)] = row.row;
  });
  const auto answers = ask<std::int32_t>(
      comm, halo, [&](std::int32_t node) { return slab.find_home(node); },
      [&](std::int32_t node) { return row_at_home[slab.find_place(node, rank)]; });
  std::copy(answers.begin(), answers.end(), local.row.begin() + local.owned_nodes);
}

void count_ranks(MPI_Comm comm, fem::Distribution& pieces) {
  const auto& local = pieces.local;
  std::vector<std::array<std::int64_t, 3>> mine;
  petsc::run_agreed(comm, [&] {
    mine.push_back({local.tet_count(), local.owned_nodes, static_cast<std::int64_t>(local.nodes_m.size()) - local.owned_nodes});
  });
  const auto all = share(comm, mine);
  petsc::run_agreed(comm, [&] {
    std::int64_t most_tets = 0, most_nodes = 0;
    for (const auto& [tets, owned, halo] : all) {
      pieces.report.ranks.push_back({tets, owned, halo});
      most_tets = std::max(most_tets, tets);
      most_nodes = std::max(most_nodes, owned);
    }
    const auto ranks = static_cast<double>(all.size());
    pieces.report.element_balance = static_cast<double>(most_tets) * ranks / static_cast<double>(pieces.tets);
    pieces.report.node_balance = static_cast<double>(most_nodes) * ranks / static_cast<double>(pieces.nodes);
  });
}

}  // namespace

fem::Distribution settle(MPI_Comm comm, const std::string& name, Slab& slab, const std::vector<std::int32_t>& part, const Wish& wish,
                         std::int64_t& held_nodes, std::vector<char>& on_seam) {
  const int rank = get_rank(comm);
  fem::Distribution pieces;
  pieces.nodes = slab.node_count();
  pieces.tets = slab.elements.total();
  held_nodes = std::count_if(slab.held.begin(), slab.held.end(), [](std::int32_t held) { return held != 0; });
  MPI_Allreduce(MPI_IN_PLACE, &held_nodes, 1, MPI_INT64_T, MPI_SUM, comm);
  Piece piece = slab.order == 1 ? move_elements<4>(comm, slab, part) : move_elements<10>(comm, slab, part);

  // The nodes of this rank, and its own components: nodes joined by its elements.
  std::vector<std::int32_t> numbers, group, lowest;
  petsc::run_agreed(comm, [&] {
    numbers = piece.tets;
    std::sort(numbers.begin(), numbers.end());
    numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
    numbers.shrink_to_fit();
    for (std::int32_t& node : piece.tets)
      node = static_cast<std::int32_t>(std::lower_bound(numbers.begin(), numbers.end(), node) - numbers.begin());
    mesh::Parts parts(numbers.size());
    const std::size_t width = slab.width();
    for (std::size_t i = 0; i < piece.tets.size(); ++i) parts.join(piece.tets[i / width * width], piece.tets[i]);
    group.assign(numbers.size(), -1);
    for (std::size_t i = 0; i < numbers.size(); ++i) {  // the root is the lowest, and comes first
      const auto root = static_cast<std::size_t>(parts.find(static_cast<std::int32_t>(i)));
      if (root == i) {
        group[i] = static_cast<std::int32_t>(lowest.size());
        lowest.push_back(numbers[i]);
      } else {
        group[i] = group[root];
      }
    }
  });
  const Homes groups = gather_homes(comm, static_cast<std::int64_t>(lowest.size()));
  const auto first_group = static_cast<std::int32_t>(groups.first[static_cast<std::size_t>(rank)]);

  std::vector<Touch> touches;
  std::vector<std::size_t> order;
  petsc::run_agreed(comm, [&] {
    for (std::size_t i = 0; i < numbers.size(); ++i) touches.push_back({numbers[i], first_group + group[i]});
  });
  const auto arrived = route(
      comm, touches, [&](const Touch& touch) { return slab.find_home(touch.node); }, &order);
  touches = {};
  std::vector<char> is_shared_at_home;
  std::vector<NodeAnswer> replies;
  std::vector<std::pair<std::int32_t, std::int32_t>> links;
  petsc::run_agreed(comm, [&] {
    const auto owner = find_owners(rank, slab, arrived, is_shared_at_home);
    std::vector<std::int32_t> group_at_home(slab.nodes_m.size(), -1);
    for (const Touch& touch : arrived.items) {
      const std::size_t i = slab.find_place(touch.node, rank);
      replies.push_back({slab.nodes_m[i], owner[i], is_shared_at_home[i], slab.held[i]});
      if (group_at_home[i] < 0) group_at_home[i] = touch.group;
      if (group_at_home[i] != touch.group) links.emplace_back(std::minmax(group_at_home[i], touch.group));
    }
  });
  const auto answers = exchange(comm, replies, arrived.count);
  const auto component = find_components(comm, lowest, std::move(links), pieces.components);

  petsc::run_agreed(comm, [&] {
    std::vector<LocalNode> nodes(numbers.size());
    for (std::size_t k = 0; k < order.size(); ++k) {
      const std::size_t i = order[k];
      const NodeAnswer& answer = answers.items[k];
      nodes[i] = {numbers[i],  answer.owner,          component[static_cast<std::size_t>(first_group + group[i])],
                  answer.held, answer.is_shared != 0, answer.x};
    }
    pieces.local = make_local(rank, slab.order, piece, nodes, on_seam);
  });
  number_rows(comm, name, slab, on_seam, pieces);
  if (!wish.hold.empty()) pieces.held_m = share_holding_points(comm, pieces.local, pieces.components);
  count_ranks(comm, pieces);
  slab.nodes_m = {};
  slab.held = {};
  return pieces;
}

}  // namespace carillon::slabs
