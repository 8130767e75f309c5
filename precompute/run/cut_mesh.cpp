#include "precompute/run/cut_mesh.hpp"

#include <algorithm>
#include <span>
#include <utility>

#include "precompute/comm/index_partition.hpp"
#include "precompute/ldlt/mesh_order.hpp"

namespace carillon::run {
namespace {

using Ints = std::vector<std::int32_t>;

constexpr std::int64_t kNodesOfARank = 300;  // fewer: what travels in a solve is less than what orders and cuts cost
constexpr double kFullest = 1.5;             // elements of a rank over the mean

/// The rank of each of this rank's elements, all of whose nodes may be fixed; empty on all ranks where one would have too many or none.
/// Collective.
Ints find_parts(const comm::Communicator& comm, const ldlt::MeshOrder& order, std::span<const std::int32_t> elements, int width) {
  Ints part = order.find_ranks(comm, elements, width);
  std::vector<std::int64_t> counts(static_cast<std::size_t>(comm.size()), 0);
  for (std::int32_t& rank : part) ++counts[static_cast<std::size_t>(rank = std::max(rank, 0))];
  comm.sum(std::span<std::int64_t>(counts));
  std::int64_t all = 0;
  for (const std::int64_t count : counts) all += count;
  const auto [least, most] = std::minmax_element(counts.begin(), counts.end());
  const bool is_even = *least > 0 && static_cast<double>(*most) * comm.size() <= kFullest * static_cast<double>(all);
  return is_even ? part : Ints();
}

}  // namespace

bool is_cut_by_order(const comm::Communicator& comm, std::int64_t free_nodes) {
  return comm.size() > 1 && free_nodes >= kNodesOfARank * comm.size();
}

CutMesh cut_by_order(const comm::Communicator& comm, const mesh::TetMesh& mesh, const std::vector<std::int32_t>& fixed_nodes) {
  Ints number;    // (N) of each free node in use, -1: another
  Ints elements;  // the same of the elements' nodes
  const std::int64_t free_nodes = comm.broadcast([&] {
    number.assign(mesh.nodes_m.size(), -1);
    for (const std::int32_t node : mesh.tets) number[static_cast<std::size_t>(node)] = 0;
    for (const std::int32_t node : fixed_nodes)
      if (node >= 0 && node < static_cast<std::int64_t>(number.size())) number[static_cast<std::size_t>(node)] = -1;
    std::int32_t count = 0;
    for (std::int32_t& node : number)
      if (node == 0) node = count++;
    for (const std::int32_t node : mesh.tets) elements.push_back(number[static_cast<std::size_t>(node)]);
    return std::int64_t{count};
  });
  if (!is_cut_by_order(comm, free_nodes)) return {partition::distribute(comm, mesh, fixed_nodes), nullptr};
  const int width = comm.broadcast(mesh.nodes_per_tet());
  const comm::IndexPartition owners(comm, comm.is_root() ? free_nodes : 0);
  auto order = std::make_shared<ldlt::MeshOrder>(comm, elements, width, owners);
  CutMesh cut;
  cut.pieces = partition::distribute(comm, mesh, fixed_nodes, {.part = find_parts(comm, *order, elements, width)});
  const Ints rows = comm.agree([&] {
    Ints list(static_cast<std::size_t>(owners.own_count()));
    for (std::size_t v = 0; v < number.size(); ++v)
      if (number[v] >= 0) list[static_cast<std::size_t>(number[v])] = cut.pieces.row_of_node[v];
    return list;
  });
  order->renumber(comm, rows);
  cut.order = std::move(order);
  return cut;
}

void cut_by_order(const comm::Communicator& comm, parallel_mesh::ReadOptions& options, std::shared_ptr<const ldlt::MeshOrder>& order) {
  auto made = std::make_shared<std::shared_ptr<ldlt::MeshOrder>>();
  options.recut = [&comm, made](const partition::LocalMesh& first, std::int64_t free_nodes) -> Ints {
    if (!is_cut_by_order(comm, free_nodes)) return {};
    const Ints elements = comm.agree([&] {
      Ints rows;
      for (const std::int32_t node : first.tets) rows.push_back(first.row[static_cast<std::size_t>(node)]);
      return rows;
    });
    *made = std::make_shared<ldlt::MeshOrder>(comm, elements, first.nodes_per_tet(), comm::IndexPartition(comm, first.free_nodes));
    return find_parts(comm, **made, elements, first.nodes_per_tet());
  };
  options.renumber = [&comm, &order, made](const Ints& rows) {
    if (*made == nullptr) return;
    (*made)->renumber(comm, rows);
    order = std::move(*made);
  };
}

}  // namespace carillon::run
