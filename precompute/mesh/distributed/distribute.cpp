// Method: Elements are distributed as given by the caller, or by METIS k-way on the dual graph. A node belongs to one of the ranks of its
// elements: with a given distribution to the one with the fewest so far, otherwise to the highest. Rank 0 makes and sends the parts one at
// a time.
// Source: Karypis and Kumar 1998 (METIS).
#include "precompute/mesh/distributed/distribute.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <numeric>
#include <utility>

#include "partition/partition.hpp"
#include "precompute/comm/exchange.hpp"
#include "precompute/mesh/parts.hpp"
#include "runtime/base/error.hpp"

namespace carillon::mesh {
namespace {

/// Decisions of rank 0 before it sends the parts.
struct Plan {
  std::vector<std::vector<std::int32_t>> elements;  // (ranks) elements of each rank, ascending
  std::vector<std::int32_t> owner;                  // (N) rank of each node, -1: unused node
  std::vector<std::int32_t> component;              // (N)
  std::vector<bool> is_fixed;                       // (N)
  std::vector<std::int32_t> row;                    // (N), -1: fixed or unused
  std::vector<std::int32_t> first_row;              // (ranks + 1)
  std::vector<std::int32_t> local;                  // (N) scratch of make_local_mesh(): all -1 before and after
};

/// Components in the order of their first nodes; -1: unused node.
std::vector<std::int32_t> find_components(const mesh::TetMesh& mesh, std::int32_t& count) {
  mesh::Parts parts(mesh.nodes_m.size());
  std::vector<bool> used(mesh.nodes_m.size(), false);
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
    for (const std::int32_t node : mesh.tet(e)) {
      used[node] = true;
      parts.join(mesh.tet(e)[0], node);
    }
  std::vector<std::int32_t> component(mesh.nodes_m.size(), -1), of_part(mesh.nodes_m.size(), -1);
  count = 0;
  for (std::size_t v = 0; v < component.size(); ++v) {
    if (!used[v]) continue;
    std::int32_t& part = of_part[parts.find(static_cast<std::int32_t>(v))];
    if (part < 0) part = count++;
    component[v] = part;
  }
  return component;
}

/// Highest rank that touches each node. Distributing the nodes of an interface evenly would balance the rows exactly, but enlarge the
/// separator of a factorisation ordered by rank by half (bunny, 2 ranks: 794 nodes instead of 540).
std::vector<std::int32_t> find_node_owners(const mesh::TetMesh& mesh, const std::vector<std::int32_t>& part) {
  std::vector<std::int32_t> owner(mesh.nodes_m.size(), -1);
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
    for (const std::int32_t node : mesh.tet(e)) owner[node] = std::max(owner[node], part[e]);
  return owner;
}

/// Counts the nodes touched by one rank only, then gives each other node to its rank with the fewest so far.
void level_node_owners(const mesh::TetMesh& mesh, const std::vector<std::int32_t>& part, int ranks, std::vector<std::int32_t>& owner) {
  struct Touch {
    std::int32_t node, rank;
    auto operator<=>(const Touch&) const = default;
  };
  std::vector<Touch> seams;  // all ranks of a node except the highest
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e)
    for (const std::int32_t node : mesh.tet(e))
      if (part[e] != owner[node]) seams.push_back({node, part[e]});
  std::sort(seams.begin(), seams.end());
  seams.erase(std::unique(seams.begin(), seams.end()), seams.end());
  std::vector<std::int64_t> nodes(ranks, 0);
  for (const std::int32_t rank : owner)
    if (rank >= 0) ++nodes[rank];
  for (auto at = seams.begin(); at != seams.end();
       at = std::find_if(at, seams.end(), [node = at->node](const Touch& one) { return one.node != node; }))
    --nodes[owner[at->node]];
  for (auto at = seams.begin(); at != seams.end();) {
    const std::int32_t node = at->node;
    for (; at != seams.end() && at->node == node; ++at)
      if (nodes[at->rank] < nodes[owner[node]]) owner[node] = at->rank;
    ++nodes[owner[node]];
  }
}

std::vector<bool> mark_fixed(const mesh::TetMesh& mesh, const std::vector<std::int32_t>& fixed_nodes) {
  std::vector<bool> is_fixed(mesh.nodes_m.size(), false);
  for (const std::int32_t node : fixed_nodes) {
    if (node < 0 || node >= static_cast<std::int64_t>(mesh.nodes_m.size()))
      throw InputError(fmt::format("fixed node {} is not in the mesh, which has {} nodes", node, mesh.nodes_m.size()));
    is_fixed[node] = true;
  }
  return is_fixed;
}

partition::Partition cut_mesh(const mesh::TetMesh& mesh, int ranks, const std::vector<std::int32_t>& part) {
  const auto cut = [&](const std::vector<std::int32_t>& corners) {
    return part.empty() ? partition::partition_elements(corners, ranks) : partition::measure_parts(corners, part, ranks);
  };
  if (mesh.order == 1) return cut(mesh.tets);
  std::vector<std::int32_t> corners;
  corners.reserve(4 * mesh.tet_count());
  for (std::int64_t e = 0; e < mesh.tet_count(); ++e) corners.insert(corners.end(), mesh.tet(e).begin(), mesh.tet(e).begin() + 4);
  return cut(corners);
}

/// Numbers the free nodes by owner, then by node.
void number_rows(Plan& plan, int ranks, DistributedMesh& out) {
  plan.first_row.assign(ranks + 1, 0);
  for (std::size_t v = 0; v < plan.owner.size(); ++v) {
    if (plan.owner[v] < 0) continue;
    ++out.nodes;
    if (!plan.is_fixed[v]) ++plan.first_row[plan.owner[v] + 1];
  }
  std::partial_sum(plan.first_row.begin(), plan.first_row.end(), plan.first_row.begin());
  out.free_nodes = plan.first_row.back();
  check_free_nodes(out.free_nodes, "");
  std::vector<std::int32_t> next(plan.first_row.begin(), plan.first_row.end() - 1);
  plan.row.assign(plan.owner.size(), -1);
  for (std::size_t v = 0; v < plan.owner.size(); ++v)
    if (plan.owner[v] >= 0 && !plan.is_fixed[v]) plan.row[v] = next[plan.owner[v]]++;
}

std::vector<std::vector<Vec3>> list_supporting_points(const mesh::TetMesh& mesh, const Plan& plan, std::int32_t components) {
  std::vector<FixedPoint> points;
  for (std::size_t v = 0; v < plan.is_fixed.size(); ++v)
    if (plan.is_fixed[v] && plan.owner[v] >= 0) points.push_back({mesh.nodes_m[v], plan.component[v]});
  return find_supporting_points(points, components);
}

std::vector<std::int32_t> find_elimination_order(const mesh::TetMesh& mesh, const Plan& plan, std::int64_t free_nodes) {
  std::vector<std::int32_t> rows(mesh.tets.size());
  for (std::size_t i = 0; i < rows.size(); ++i) rows[i] = plan.row[mesh.tets[i]];
  return partition::order_nested_dissection(partition::make_node_graph(rows, mesh.nodes_per_tet(), static_cast<std::int32_t>(free_nodes)));
}

Plan make_plan(const mesh::TetMesh& mesh, const std::vector<std::int32_t>& fixed_nodes, int ranks, const DistributeOptions& options,
               DistributedMesh& out) {
  Plan plan;
  plan.is_fixed = mark_fixed(mesh, fixed_nodes);
  const partition::Partition cut = cut_mesh(mesh, ranks, options.part);
  out.tets = mesh.tet_count();
  out.report.edge_cut = cut.quality.edge_cut;
  out.report.contiguous = cut.quality.contiguous;
  plan.elements.resize(ranks);
  for (std::size_t e = 0; e < cut.part.size(); ++e) plan.elements[cut.part[e]].push_back(static_cast<std::int32_t>(e));
  plan.component = find_components(mesh, out.components);
  plan.owner = find_node_owners(mesh, cut.part);
  if (!options.part.empty()) level_node_owners(mesh, cut.part, ranks, plan.owner);
  plan.local.assign(mesh.nodes_m.size(), -1);
  number_rows(plan, ranks, out);
  if (!fixed_nodes.empty()) out.fixed_m = list_supporting_points(mesh, plan, out.components);
  if (options.elimination_order) out.elimination_position = find_elimination_order(mesh, plan, out.free_nodes);
  return plan;
}

/// Part of `rank`, with its nodes in the order of LocalMesh.
LocalMesh make_local_mesh(const mesh::TetMesh& mesh, Plan& plan, int rank) {
  const std::vector<std::int32_t>& elements = plan.elements[rank];
  LocalMesh local;
  std::vector<std::int32_t>& touched = local.node_in_mesh;
  for (const std::int32_t e : elements)
    for (const std::int32_t node : mesh.tet(e)) {
      if (plan.local[node] >= 0) continue;
      plan.local[node] = 0;
      touched.push_back(node);
    }
  const auto kind = [&](std::int32_t node) { return plan.owner[node] != rank ? 2 : plan.is_fixed[node] ? 1 : 0; };
  std::sort(touched.begin(), touched.end(), [&](std::int32_t a, std::int32_t b) { return std::pair(kind(a), a) < std::pair(kind(b), b); });
  local.order = mesh.order;
  local.first_row = plan.first_row[rank];
  for (std::size_t i = 0; i < touched.size(); ++i) {
    const std::int32_t node = touched[i];
    plan.local[node] = static_cast<std::int32_t>(i);
    local.free_nodes += kind(node) == 0;
    local.owned_nodes += kind(node) < 2;
    local.row.push_back(plan.row[node]);
    local.component.push_back(plan.component[node]);
    local.nodes_m.push_back(mesh.nodes_m[node]);
    if (!mesh.doubt_m.empty()) local.doubt_m.push_back(mesh.doubt_m[node]);
  }
  local.tet_in_mesh = elements;
  local.tets.reserve(elements.size() * mesh.nodes_per_tet());
  for (const std::int32_t e : elements) {
    local.region.push_back(e < std::ssize(mesh.regions) ? mesh.regions[e] : 0);
    for (const std::int32_t node : mesh.tet(e)) local.tets.push_back(plan.local[node]);
  }
  for (const std::int32_t node : touched) plan.local[node] = -1;
  return local;
}

/// Broadcasts the totals known on rank 0. Collective.
void broadcast_totals(const comm::Communicator& comm, DistributedMesh& out) {
  struct Totals {
    std::int64_t nodes, tets, free_nodes, edge_cut;
    std::int32_t components;
    bool contiguous, has_fixed;
  };
  const Totals totals = comm.broadcast(
      Totals{out.nodes, out.tets, out.free_nodes, out.report.edge_cut, out.components, out.report.contiguous, !out.fixed_m.empty()});
  out.nodes = totals.nodes;
  out.tets = totals.tets;
  out.free_nodes = totals.free_nodes;
  out.report.edge_cut = totals.edge_cut;
  out.components = totals.components;
  out.report.contiguous = totals.contiguous;
  if (!totals.has_fixed) return;
  const auto points = comm.broadcast([&] { return list_points(out.fixed_m); });
  out.fixed_m = comm.agree([&] { return find_supporting_points(points, out.components); });
}

}  // namespace

std::vector<std::int32_t> list_free_nodes(const mesh::TetMesh& mesh, const std::vector<std::int32_t>& fixed_nodes) {
  const std::vector<bool> is_fixed = mark_fixed(mesh, fixed_nodes);
  std::vector<bool> is_free(mesh.nodes_m.size(), false);
  for (const std::int32_t node : mesh.tets) is_free[node] = !is_fixed[node];
  std::vector<std::int32_t> nodes;
  for (std::size_t v = 0; v < is_free.size(); ++v)
    if (is_free[v]) nodes.push_back(static_cast<std::int32_t>(v));
  check_free_nodes(static_cast<std::int64_t>(nodes.size()), "");
  return nodes;
}

DistributedMesh distribute(const comm::Communicator& comm, const mesh::TetMesh& mesh, const std::vector<std::int32_t>& fixed_nodes,
                           const DistributeOptions& options) {
  DistributedMesh out;
  Plan plan = comm.agree([&] { return comm.is_root() ? make_plan(mesh, fixed_nodes, comm.size(), options, out) : Plan(); });
  out.local = comm::scatter_in_turn(
      comm, [&](int rank) { return make_local_mesh(mesh, plan, rank); }, serialise, deserialise);
  out.row_of_node = std::move(plan.row);
  broadcast_totals(comm, out);
  report_ranks(comm, out);
  return out;
}

}  // namespace carillon::mesh
