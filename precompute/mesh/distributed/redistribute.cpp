// Method: Elements are sent to their parts. Every rank asks the holder of each node (the rank with the node in its block) for position and
// owner; the holder assigns the node to the highest of the asking ranks. Owners number their free nodes in ascending order, and the holders
// pass the numbers on to the halos. Components: each rank joins its own nodes to groups; the holders find groups that share a node; these
// few pairs are sent to all ranks.
#include "precompute/mesh/distributed/redistribute.hpp"

#include <algorithm>
#include <array>
#include <numeric>
#include <utility>

#include "precompute/comm/exchange.hpp"
#include "precompute/mesh/parts.hpp"

namespace carillon::mesh {
namespace {

/// This rank's elements in the order of their numbers.
struct Elements {
  std::vector<std::int32_t> tets;    // (e, width) node numbers; later indices into Nodes
  std::vector<std::int32_t> number;  // (e)
  std::vector<std::int32_t> region;  // (e)
};

template <std::size_t width>
struct Element {
  std::int32_t number, region;
  std::array<std::int32_t, width> nodes;
};

/// Collective.
template <std::size_t width>
Elements move_elements(const comm::Communicator& comm, MeshBlock& block, const std::vector<std::int32_t>& part) {
  const auto first = static_cast<std::int32_t>(block.elements.own_begin());
  const auto list_elements = [&] {
    std::vector<Element<width>> elements(part.size());
    for (std::size_t e = 0; e < part.size(); ++e) {
      elements[e].number = first + static_cast<std::int32_t>(e);
      elements[e].region = block.regions[e];
      std::copy_n(block.tets.begin() + static_cast<std::ptrdiff_t>(e * width), width, elements[e].nodes.begin());
    }
    block.tets = {};
    block.regions = {};
    block.centres_m = {};
    return elements;
  };
  auto arrived = comm::all_to_all(comm, list_elements, [&](const Element<width>& element) { return part[element.number - first]; });
  return comm.agree([&] {
    std::sort(arrived.items.begin(), arrived.items.end(), [](const auto& x, const auto& y) { return x.number < y.number; });
    Elements elements;
    elements.tets.reserve(width * arrived.items.size());
    for (const auto& element : arrived.items) {
      elements.tets.insert(elements.tets.end(), element.nodes.begin(), element.nodes.end());
      elements.number.push_back(element.number);
      elements.region.push_back(element.region);
    }
    return elements;
  });
}

/// Nodes of this rank's elements, and groups of nodes connected by them.
struct Nodes {
  std::vector<std::int32_t> number;  // (n) ascending
  std::vector<std::int32_t> group;   // (n)
  std::vector<std::int32_t> lowest;  // (groups) lowest node number of each group
};

/// Replaces the node numbers in elements.tets by indices.
Nodes find_nodes(Elements& elements, std::size_t width) {
  Nodes nodes;
  nodes.number = elements.tets;
  std::sort(nodes.number.begin(), nodes.number.end());
  nodes.number.erase(std::unique(nodes.number.begin(), nodes.number.end()), nodes.number.end());
  nodes.number.shrink_to_fit();
  for (std::int32_t& node : elements.tets)
    node = static_cast<std::int32_t>(std::lower_bound(nodes.number.begin(), nodes.number.end(), node) - nodes.number.begin());
  mesh::Parts parts(nodes.number.size());
  for (std::size_t i = 0; i < elements.tets.size(); ++i) parts.join(elements.tets[i / width * width], elements.tets[i]);
  nodes.group.resize(nodes.number.size());
  for (std::size_t i = 0; i < nodes.number.size(); ++i) {  // the root is the lowest index, so it comes first
    const std::size_t root = parts.find(static_cast<std::int32_t>(i));
    if (root == i) nodes.lowest.push_back(nodes.number[i]);
    nodes.group[i] = root == i ? static_cast<std::int32_t>(nodes.lowest.size()) - 1 : nodes.group[root];
  }
  return nodes;
}

/// A node touched by a rank, and its group there.
struct Touch {
  std::int32_t node, group;
};

/// Answer of the holder of a node.
struct NodeAnswer {
  Vec3 x_m;
  std::int32_t owner;
  std::int32_t is_shared;
  std::int32_t fixed;  // MeshBlock::fixed
};

/// Groups of any ranks, numbered globally, that share a node.
struct Link {
  std::int32_t a, b;
  auto operator<=>(const Link&) const = default;
};

/// Answers for the nodes of this rank's block, which are assigned to the highest rank that touches them; `links` gets the groups that share
/// a node.
std::vector<NodeAnswer> answer_touches(const MeshBlock& block, const comm::IndexPartition& groups, const comm::ByRank<Touch>& touches,
                                       std::vector<Link>& links) {
  std::vector<NodeAnswer> at(block.nodes_m.size());
  std::vector<std::int32_t> group_at(block.nodes_m.size(), -1);
  for (std::size_t i = 0; i < at.size(); ++i) at[i] = {block.nodes_m[i], -1, 0, block.fixed[i]};
  for (int rank = 0; rank < touches.rank_count(); ++rank)
    for (const Touch& touch : touches.of(rank)) {
      const std::size_t i = block.to_local(touch.node);
      const auto group = static_cast<std::int32_t>(groups.begin(rank)) + touch.group;
      if (at[i].owner >= 0) at[i].is_shared = 1;
      at[i].owner = rank;  // ranks ascend
      if (group_at[i] < 0) group_at[i] = group;
      if (group_at[i] != group) links.push_back({std::min(group_at[i], group), std::max(group_at[i], group)});
    }
  std::vector<NodeAnswer> answers;
  answers.reserve(touches.items.size());
  for (const Touch& touch : touches.items) answers.push_back(at[block.to_local(touch.node)]);
  return answers;
}

/// Component of every group of all ranks, numbered by lowest node, the same on every rank.
std::vector<std::int32_t> join_groups(const std::vector<Link>& links, const std::vector<std::int32_t>& lowest_node, std::int32_t& count) {
  mesh::Parts parts(lowest_node.size());
  for (const Link& link : links) parts.join(link.a, link.b);
  std::vector<std::int32_t> root(lowest_node.size()), lowest(lowest_node.size(), INT32_MAX);
  for (std::size_t g = 0; g < root.size(); ++g) {
    root[g] = parts.find(static_cast<std::int32_t>(g));
    auto& low = lowest[root[g]];
    low = std::min(low, lowest_node[g]);
  }
  std::vector<std::pair<std::int32_t, std::int32_t>> roots;  // lowest node, group
  for (std::size_t g = 0; g < root.size(); ++g)
    if (root[g] == static_cast<std::int32_t>(g)) roots.emplace_back(lowest[g], root[g]);
  std::sort(roots.begin(), roots.end());
  count = static_cast<std::int32_t>(roots.size());
  std::vector<std::int32_t> of_root(lowest_node.size(), -1), component;
  for (std::int32_t i = 0; i < count; ++i) of_root[roots[i].second] = i;
  for (const std::int32_t one : root) component.push_back(of_root[one]);
  return component;
}

/// Collective.
std::vector<std::int32_t> find_components(const comm::Communicator& comm, const std::vector<std::int32_t>& lowest_node,
                                          std::vector<Link>& links, std::int32_t& count) {
  const auto all_links = comm.all_gather([&] {
    std::sort(links.begin(), links.end());
    links.erase(std::unique(links.begin(), links.end()), links.end());
    return links;
  });
  const auto all_lowest = comm.all_gather(lowest_node);
  return comm.agree([&] { return join_groups(all_links, all_lowest, count); });
}

/// Data of a node touched by this rank.
struct LocalNode {
  std::int32_t number, component;
  NodeAnswer answer;
};

/// Sorts and counts the nodes as required by LocalMesh; does not set rows.
LocalMesh make_local_mesh(int rank, int order, Elements& elements, const std::vector<LocalNode>& nodes, std::vector<char>& on_seam) {
  LocalMesh local;
  local.order = order;
  std::vector<std::int32_t> sorted(nodes.size());
  std::iota(sorted.begin(), sorted.end(), 0);
  const auto kind = [&](const LocalNode& node) { return node.answer.owner != rank ? 2 : node.answer.fixed != 0 ? 1 : 0; };
  std::sort(sorted.begin(), sorted.end(), [&](std::int32_t i, std::int32_t j) {
    const LocalNode &a = nodes[i], &b = nodes[j];
    return std::pair(kind(a), a.number) < std::pair(kind(b), b.number);
  });
  std::vector<std::int32_t> place(nodes.size());
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    const LocalNode& node = nodes[sorted[i]];
    place[sorted[i]] = static_cast<std::int32_t>(i);
    local.nodes_m.push_back(node.answer.x_m);
    local.node_in_mesh.push_back(node.number);
    local.component.push_back(node.component);
    local.fixed_by.push_back(node.answer.fixed - 1);
    on_seam.push_back(node.answer.is_shared != 0);
    local.free_nodes += kind(node) == 0;
    local.owned_nodes += kind(node) < 2;
  }
  local.row.assign(nodes.size(), -1);
  local.tets = std::move(elements.tets);
  for (std::int32_t& node : local.tets) node = place[node];
  local.tet_in_mesh = std::move(elements.number);
  local.region = std::move(elements.region);
  return local;
}

/// Numbers the free nodes of all ranks; the holders pass the rows of shared nodes on to the halos. Collective.
void number_rows(const comm::Communicator& comm, const MeshBlock& block, const std::vector<char>& on_seam, LocalMesh& local) {
  struct Row {
    std::int32_t node, row;
  };
  const auto list_shared_rows = [&] {
    std::vector<Row> rows;
    for (std::size_t i = 0; i < static_cast<std::size_t>(local.free_nodes); ++i)
      if (on_seam[i] != 0) rows.push_back({local.node_in_mesh[i], local.row[i]});
    return rows;
  };
  for (std::int32_t i = 0; i < local.free_nodes; ++i) local.row[i] = local.first_row + i;
  const auto shared = comm::all_to_all(comm, list_shared_rows, [&](const Row& row) { return block.find_owner(row.node); });
  const auto halo = comm.agree([&] { return std::vector(local.node_in_mesh.begin() + local.owned_nodes, local.node_in_mesh.end()); });
  const auto find_rows = [&](const comm::ByRank<std::int32_t>& nodes) {
    std::vector<std::int32_t> row_at(block.nodes_m.size(), -1), rows;
    for (const Row& row : shared.items) row_at[block.to_local(row.node)] = row.row;
    for (const std::int32_t node : nodes.items) rows.push_back(row_at[block.to_local(node)]);
    return rows;
  };
  const auto rows = comm::query_owners<std::int32_t>(
      comm, halo, [&](std::int32_t node) { return block.find_owner(node); }, find_rows);
  std::copy(rows.begin(), rows.end(), local.row.begin() + local.owned_nodes);
}

/// Supporting points of this rank's fixed nodes, per component.
std::vector<FixedPoint> list_own_points(const LocalMesh& local, std::int32_t components) {
  std::vector<FixedPoint> points;
  for (auto i = static_cast<std::size_t>(local.free_nodes); i < static_cast<std::size_t>(local.owned_nodes); ++i)
    points.push_back({local.nodes_m[i], local.component[i]});
  return list_points(find_supporting_points(points, components));
}

}  // namespace

DistributedMesh redistribute(const comm::Communicator& comm, const std::string& name, MeshBlock& block,
                             const std::vector<std::int32_t>& part, bool has_fixed, std::vector<char>& on_seam) {
  DistributedMesh out;
  out.nodes = block.node_count();
  out.tets = block.elements.total();
  Elements elements = block.order == 1 ? move_elements<4>(comm, block, part) : move_elements<10>(comm, block, part);
  std::vector<Touch> touches;
  const Nodes nodes = comm.agree([&] {
    Nodes found = find_nodes(elements, block.width());
    for (std::size_t i = 0; i < found.number.size(); ++i) touches.push_back({found.number[i], found.group[i]});
    return found;
  });
  const comm::IndexPartition groups(comm, static_cast<std::int64_t>(nodes.lowest.size()));
  std::vector<Link> links;
  const auto answers = comm::query_owners<NodeAnswer>(
      comm, touches, [&](const Touch& touch) { return block.find_owner(touch.node); },
      [&](const comm::ByRank<Touch>& asked) { return answer_touches(block, groups, asked, links); });
  const auto component = find_components(comm, nodes.lowest, links, out.components);
  out.local = comm.agree([&] {
    std::vector<LocalNode> list;
    for (std::size_t i = 0; i < nodes.number.size(); ++i)
      list.push_back({nodes.number[i], component[groups.own_begin() + nodes.group[i]], answers[i]});
    return make_local_mesh(comm.rank(), block.order, elements, list, on_seam);
  });
  const comm::IndexPartition rows(comm, out.local.free_nodes);
  out.free_nodes = rows.total();
  check_free_nodes(out.free_nodes, name + ": ");  // the same on every rank
  out.local.first_row = static_cast<std::int32_t>(rows.own_begin());
  number_rows(comm, block, on_seam, out.local);
  if (has_fixed) {
    const auto points = comm.all_gather([&] { return list_own_points(out.local, out.components); });
    out.fixed_m = comm.agree([&] { return find_supporting_points(points, out.components); });
  }
  report_ranks(comm, out);
  block.nodes_m = {};
  block.fixed = {};
  return out;
}

}  // namespace carillon::mesh
